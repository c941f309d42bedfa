#include "stages/nets/avatar_pretrain.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <optional>
#include <sstream>

#include "avatar/run/pretrain/label_score.h"
#include "avatar/train/train.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/hash/sha256.h"
#include "core/json_view.h"
#include "core/quiet_run.h"
#include "core/stopwatch.h"
#include "stages/nets/avatar_run.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;
using avatar::PoseShare;
using avatar::PretrainSamples;
using Json = nlohmann::ordered_json;
using JsonView = BasicJsonView<Json>;

constexpr char kSchema[] = "mvstudio.avatar-pretraining/1";
constexpr std::string_view kUsed[] = {"width",        "downs",         "encoder-blocks",  "decoder-blocks",
                                      "norm",         "upsample",      "stem-kernel",     "head-kernel",
                                      "skips",        "inputs",        "relative-depth",  "bone-half-width-px",
                                      "batch",        "learning-rate", "decay-share",     "clip-norm",
                                      "weight-mask",  "weight-part",   "weight-uv",       "weight-logit",
                                      "jitter-scale", "jitter-shift",  "jitter-roll-deg", "ema",
                                      "save-every",   "report-every",  "device",          "amp"};

/// What decides the result, as text; the device and how often it is saved do not.
std::string OptionsText(const PretrainOptions& options) {
  std::ostringstream text;
  text.precision(17);
  const auto add = [&text](const std::string& name, const auto& value, const std::string&) {
    using Value = std::decay_t<decltype(value)>;
    if (name == "device" || name == "save-every") return;
    text << name << "=";
    if constexpr (kHasWords<Value>) {
      text << ToString(value);
    } else {
      text << value;
    }
    text << "\n";
  };
  VisitConstFields(add, options);
  return text.str();
}

std::string ArgumentsDigest(const PretrainInput& input, const PretrainOptions& options, uint64_t seed) {
  const std::string text =
      std::string(kSchema) + "\n" + OptionsText(options) + "seed=" + std::to_string(seed) + "\n" + DigestOf(input.sources);
  return Sha256Hex(text.data(), text.size());
}

/// The folder of a pretraining.
struct Folder {
  AvatarRun files;
  std::string path() const { return files.Path(kPretrainFile); }
  bool HasCheckpoint() const { return fs::exists(files.checkpoint_path()); }
};

/// What kPretrainFile says; empty without it.
Json ReadState(const Folder& folder) {
  if (!fs::exists(folder.path())) return Json::object();
  const Json json = JsonFromText<Json>(ReadFile(folder.path()), {16, false}, folder.path());
  const JsonView view(folder.path(), json);
  if (view["schema"].Text() != kSchema) view["schema"].Fail(std::string("must be ") + kSchema);
  view["arguments_sha256"].Text();
  if (view["finished"].Flag()) {
    const JsonView result = view["result"];
    result["num_parameters"].LongInt(), result["steps"].LongInt(), result["scores"]["learned"];
  }
  return json;
}

/// Whether what is there was made by the same arguments. Throws UsageError when something else would have to go.
bool IsSame(const Folder& folder, const Json& state, const std::string& digest, bool overwrite) {
  if (overwrite || !folder.HasCheckpoint()) return false;
  if (state.empty()) folder.files.RequireFree(false);
  if (state["arguments_sha256"] == digest) return true;
  throw UsageError("option 'out' " + fs::path(folder.path()).parent_path().string() +
                   " holds a network that was pretrained with other arguments: choose another folder, or give option "
                   "'overwrite'");
}

Json ToJson(const avatar::LabelScore& score) {
  return {{"samples", score.samples},
          {"part_accuracy", FiniteOrNull(score.part_accuracy)},
          {"mask_iou", FiniteOrNull(score.mask_iou)},
          {"uv_error", FiniteOrNull(score.uv_error)},
          {"surface_median_mm", FiniteOrNull(score.surface_mm)}};
}

/// Sets of samples, one after the other: each step has its own images.
class Sets {
 public:
  Sets(const PretrainInput& input, const PretrainOptions& options, const RunContext& run)
      : input_(input), options_(options), quiet_(run) {
    const int64_t batch = options.train.batch;
    steps_ = std::max<int64_t>(1, (options.samples + batch - 1) / batch);
  }
  int64_t SetOf(int64_t step) const { return step / steps_; }
  int64_t EndOf(int64_t set) const { return (set + 1) * steps_; }
  avatar::AvatarPack Draw(int64_t set) const {
    return DrawSamples(input_.sources, options_.sample, PoseShare::kLearned, set, steps_ * options_.train.batch,
                       quiet_.context())
        .pack;
  }

 private:
  const PretrainInput& input_;
  const PretrainOptions& options_;
  const QuietRun quiet_;  // drawing is no stage of its own
  int64_t steps_ = 1;
};

/// The training with its files.
class Run {
 public:
  Run(const PretrainInput& input, const PretrainOptions& options, Folder* folder, const RunContext& run)
      : sets_(input, options, run), options_(options), folder_(*folder), run_(run) {}

  /// Continues from the checkpoint, or begins.
  void Start(bool again) {
    if (!again) {
      pack_ = sets_.Draw(0);
      trainer_.emplace(pack_, options_.model, options_.train, run_);
      return;
    }
    const std::string path = folder_.files.checkpoint_path();
    const avatar::TensorFile checkpoint = avatar::ReadTensorFile(path);
    set_ = sets_.SetOf(avatar::ModelFromTensors(checkpoint, path).step);
    pack_ = sets_.Draw(set_);
    trainer_.emplace(pack_, checkpoint, path, options_.train, run_);
    earlier_s_ = folder_.files.ContinueHistory(trainer_->model().step);
  }

  /// Throws CancelledError after saving.
  avatar::TrainReport Train() {
    ProgressStage stage(run_, "pretraining", trainer_->total_steps() - trainer_->model().step);
    avatar::TrainReport all;
    try {
      do {
        all = TrainOnSet(&stage);
      } while (trainer_->model().step < trainer_->total_steps() && all.status == Status::kOk);
    } catch (const CancelledError&) {
      folder_.files.Save(*trainer_, pack_);
      throw CancelledError("interrupted after step " + std::to_string(trainer_->model().step) +
                           ": the checkpoint is saved, the same command goes on");
    }
    folder_.files.Save(*trainer_, pack_);
    return all;
  }

  avatar::Trainer& trainer() { return *trainer_; }
  double wall_s() const { return earlier_s_ + watch_.Seconds(); }

 private:
  /// To the end of the set that the next step belongs to.
  avatar::TrainReport TrainOnSet(ProgressStage* stage) {
    const int64_t step = trainer_->model().step;
    if (const int64_t set = sets_.SetOf(step); set != set_ && step < trainer_->total_steps()) {
      pack_ = sets_.Draw(set_ = set);
      trainer_->ReplaceImages(pack_);
    }
    return trainer_->Run(
        nullptr, [&](int64_t done, const avatar::HistoryRow* row) { return After(done, row, stage); }, sets_.EndOf(set_));
  }

  bool After(int64_t step, const avatar::HistoryRow* row, ProgressStage* stage) {
    if (row) folder_.files.AddRow(*row, wall_s());
    if (step % options_.train.save_every == 0) folder_.files.Save(*trainer_, pack_);
    stage->Advance(1, row ? "loss " + std::to_string((*row)["total"]) : "");
    return true;
  }

  Sets sets_;
  const PretrainOptions& options_;
  Folder& folder_;
  const RunContext& run_;
  avatar::AvatarPack pack_;
  int64_t set_ = 0;
  std::optional<avatar::Trainer> trainer_;
  double earlier_s_ = 0;
  Stopwatch watch_;
};

Json ScoresOf(avatar::Trainer& trainer, const PretrainInput& input, const PretrainOptions& options, const RunContext& run) {
  std::vector<avatar::SurfaceMap> surfaces;
  for (const body::BodyTemplate& body : input.sources.templates) surfaces.emplace_back(body);
  const bool any_held_out =
      std::any_of(input.motions.begin(), input.motions.end(), [](const MotionSource& motion) { return motion.held_out > 0; });
  constexpr int64_t kScoredSet = int64_t{1} << 40;  // none that is trained on
  Json scores = Json::object();
  const auto add = [&](const char* name, PoseShare share) {
    const PretrainSamples samples = DrawSamples(input.sources, options.sample, share, kScoredSet, options.scored, run);
    trainer.UseHanded([&](avatar::AvatarModel& model) { scores[name] = ToJson(ScoreLabels(model, samples, surfaces)); });
  };
  add("learned", PoseShare::kLearned);
  if (any_held_out) add("held_out", PoseShare::kHeldOut);
  return scores;
}

std::string ScoreRow(const std::string& name, const Json& score) {
  const auto number = [&score](const char* key) {
    const auto found = score.find(key);
    return found != score.end() && found->is_number() ? found->get<double>() : std::nan("");
  };
  return Format("%-22s%8.0f%14.4f%11.4f%9.4f%14.1f\n", name.c_str(), number("samples"), number("part_accuracy"),
                number("mask_iou"), number("uv_error"), number("surface_median_mm"));
}

std::string TextOf(const Json& m, const std::string& folder) {
  std::string text = Format("pretrained network (%d parameters): %d steps in %.0f s\n  %s\n\n", m["num_parameters"].get<int>(),
                            m["steps"].get<int>(), m["wall_s"].get<double>(), folder.c_str());
  text += "poses                  samples   parts right   mask IoU     |uv|   surface, mm\n";
  const Json& scores = m["scores"];
  text += ScoreRow("learned from", scores["learned"]);
  if (scores.contains("held_out")) text += ScoreRow("held out", scores["held_out"]);
  return text;
}

CommandResult ResultOf(const Json& metrics, const Folder& folder, const PretrainInput& input) {
  CommandResult result;
  result.metrics = metrics;
  result.folder = fs::path(folder.path()).parent_path().string();
  result.inputs = input.Paths();
  result.outputs = {{folder.files.checkpoint_path(), "checkpoint"},
                    {folder.path(), "pretraining"},
                    {folder.files.Path("history.csv"), "history"}};
  return result;
}

CommandResult Finished(const Json& metrics, double wall_s, bool cached, const Folder& folder, const PretrainInput& input) {
  CommandResult result = ResultOf(metrics, folder, input);
  result.metrics["cached"] = cached;
  result.metrics["wall_s"] = wall_s;
  result.text = TextOf(result.metrics, result.folder);
  return result;
}

/// What is known before the training.
Json BeginState(const PretrainInput& input, const PretrainOptions& options, const std::string& digest,
                const std::string& folder, bool relative, uint64_t seed) {
  Json values = Json::object();
  std::istringstream lines(OptionsText(options));
  for (std::string line; std::getline(lines, line);) values[line.substr(0, line.find('='))] = line.substr(line.find('=') + 1);
  return {{"schema", kSchema},
          {"arguments_sha256", digest},
          {"finished", false},
          {"seed", seed},
          {"options", values},
          {"templates", input.templates},
          {"sources", ToJson(input.motions, folder, relative)}};
}

CommandResult NotFinite(const avatar::TrainReport& report, const Folder& folder, const PretrainInput& input) {
  CommandResult result = ResultOf(Json::object(), folder, input);
  result.exit = kExitIllPosed;
  result.errors.push_back({"AVA-NONFINITE", report.message, "pretrain again with a smaller option 'learning-rate'"});
  return result;
}

Json MetricsOf(Run& run, const avatar::TrainReport& report, const Json& state) {
  Json m = {{"num_parameters", avatar::NumParameters(run.trainer().model().options)},
            {"steps", run.trainer().model().step},
            {"device", run.trainer().device()},
            {"arguments_sha256", state["arguments_sha256"]},
            {"templates", state["templates"]},
            {"sources", state["sources"]}};
  if (!report.history.empty()) {
    for (size_t i = 0; i < avatar::kLossColumns.size(); ++i)
      m["final"][avatar::kLossColumns[i]] = FiniteOrNull(report.history.back().values[i]);
  }
  return m;
}

}  // namespace

bool IsOfPretraining(std::string_view option) {
  return std::find(std::begin(kUsed), std::end(kUsed), option) != std::end(kUsed);
}

void Validate(const PretrainOptions& o) {
  avatar::Validate(o.sample);
  avatar::Validate(o.model);
  if (o.train.init_steps < 1 || o.train.init_steps > 100000000) throw UsageError("option 'steps' must be in 1..1e8");
  if (o.samples < 1 || o.samples > 1000000) throw UsageError("option 'samples' must be in 1..1e6");
  if (o.scored < 1 || o.scored > 1000000) throw UsageError("option 'scored-samples' must be in 1..1e6");
  avatar::Validate(o.train);
}

CommandResult Pretrain(const PretrainInput& input, const PretrainOptions& options, const std::string& out, bool overwrite,
                       bool relative, const RunContext& context) {
  Folder folder{AvatarRun(out)};
  const OutputFolder place(out, input.Paths(), AvatarRun::Names());
  const std::string digest = ArgumentsDigest(input, options, context.seed);
  Json state = overwrite ? Json::object() : ReadState(folder);
  const bool again = IsSame(folder, state, digest, overwrite);
  if (again && state["finished"] == true) {
    const JsonView kept(folder.path(), state);
    const double wall_s = folder.files.ContinueHistory(kept["result"]["steps"].LongInt());
    return Finished(state["result"], wall_s, true, folder, input);
  }
  Run run(input, options, &folder, context);
  run.Start(again);
  state = BeginState(input, options, digest, out, relative, context.seed);
  if (!again) {
    folder.files.Clear();
    WriteFileAtomic(folder.path(), state.dump(2) + "\n");
  }
  const avatar::TrainReport report = run.Train();
  if (report.status != Status::kOk) return NotFinite(report, folder, input);
  Json metrics = MetricsOf(run, report, state);
  metrics["scores"] = ScoresOf(run.trainer(), input, options, context);
  state["finished"] = true, state["result"] = metrics;
  WriteFileAtomic(folder.path(), state.dump(2) + "\n");
  return Finished(metrics, run.wall_s(), false, folder, input);
}

}  // namespace mvstudio::stages
