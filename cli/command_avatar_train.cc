#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>

#include "avatar/io/pack_builder.h"
#include "avatar/io/posenet_features.h"
#include "cli/avatar_run.h"
#include "cli/commands.h"
#include "core/error.h"
#include "core/files.h"

namespace mvstudio::cli {
namespace {

using avatar::AvatarPack;
using avatar::RunConfig;
using Clock = std::chrono::steady_clock;

struct TrainArguments {
  std::string dataset, out, train_cameras, holdout_cameras, holdout_frames;
  avatar::ModelOptions model;
  avatar::TrainOptions train;
  avatar::PackOptions pack;
  bool overwrite = false;
};

struct ResumeArguments {
  std::string run;
  int steps = -1;
};

/// Pictures of a run: those to learn from and, when something is held out, those to watch.
struct RunPacks {
  AvatarPack train;
  std::optional<AvatarPack> held_out;
  std::vector<std::string> skipped;
};

std::vector<std::string> SplitCommas(const std::string& text) {
  std::vector<std::string> names;
  std::istringstream in(text);
  for (std::string name; std::getline(in, name, ',');) {
    if (!name.empty()) names.push_back(name);
  }
  return names;
}

/// At most `count` held-out pictures, from held-out cameras and frames (all of one kind when only the other was held out).
std::optional<AvatarPack> HeldOutPack(const dataset::PanopticDataset& data, const RunConfig& config, int count,
                                      const RunContext& run) {
  const avatar::DatasetSplit& split = config.split;
  if (count == 0 || (split.holdout_cameras.empty() && split.holdout_frames.empty())) return std::nullopt;
  avatar::PackOptions options = config.pack;
  options.cameras = split.holdout_cameras.empty() ? split.train_cameras : split.holdout_cameras;
  const std::vector<int>& frames = split.holdout_frames.empty() ? split.train_frames : split.holdout_frames;
  const auto wanted = std::min(frames.size(), static_cast<size_t>(count) / options.cameras.size() + 1);
  options.frames.clear();
  for (size_t i = 0; i < wanted; ++i) options.frames.push_back(frames[(2 * i + 1) * frames.size() / (2 * wanted)]);
  try {
    return avatar::BuildPack(data, options, run).pack;
  } catch (const FormatError&) {
    return std::nullopt;  // none of these few pictures is usable; evaluation says why
  }
}

/// Fixes crop and template shape in `config` from the training pictures.
RunPacks BuildPacks(const dataset::PanopticDataset& data, int validate_pictures, const RunContext& run, RunConfig* config) {
  config->pack.cameras = config->split.train_cameras;
  config->pack.frames = config->split.train_frames;
  const avatar::PackResult built = avatar::BuildPack(data, config->pack, run);
  config->shape = config->pack.shape = built.shape;
  config->half_extent_m = config->pack.half_extent_m = built.half_extent_m;
  config->template_iou = built.template_iou;
  config->pack.person = built.person;
  config->pack.fit_shape = false;
  return {built.pack, HeldOutPack(data, *config, validate_pictures, run), built.skipped};
}

/// Trains to the end with checkpoints on the way. A request to stop saves first.
CommandResult TrainAndSave(avatar::Trainer& trainer, AvatarRun& files, const RunPacks& packs,
                           const avatar::TrainOptions& options, double earlier_s, CommandContext& context) {
  const Clock::time_point start = Clock::now();
  const auto wall_s = [&] { return earlier_s + std::chrono::duration<double>(Clock::now() - start).count(); };
  const AvatarPack* held_out = packs.held_out ? &*packs.held_out : nullptr;
  const AvatarPack& samples = held_out ? *held_out : packs.train;
  const int64_t first = trainer.model().step;
  ProgressStage stage(context.run, "training", InitSteps(options) + int64_t{options.steps} - first);
  bool stopped = false;
  std::map<std::string, avatar::HistoryRow> last;
  const auto callback = [&](int64_t step, const avatar::HistoryRow* row) {
    if (row) files.AddRow(*row, wall_s()), last[row->phase] = *row;
    if (row && row->phase == "validation") return true;
    if (step % options.save_every == 0) files.Save(trainer, samples);
    stopped = context.run.progress && context.run.progress->Cancelled();
    if (!stopped) stage.Advance(1, row ? row->phase + " loss " + std::to_string((*row)["total"]) : "");
    return !stopped;
  };
  const avatar::TrainReport report = trainer.Run(held_out, callback);
  const double seconds = wall_s() - earlier_s;
  files.Save(trainer, samples);
  if (stopped) {
    throw CancelledError("interrupted after step " + std::to_string(trainer.model().step) +
                         ": the checkpoint is saved, `mvstudio avatar resume` goes on");
  }
  CommandResult result;
  auto& m = result.metrics;
  m["method"] = trainer.model().options.method;
  m["num_parameters"] = avatar::NumParameters(trainer.model().options);
  m["steps"] = trainer.model().step;
  for (const auto& [phase, row] : last) {
    m["final"][phase]["step"] = row.step;
    for (size_t i = 0; i < row.values.size(); ++i) m["final"][phase][avatar::kLossColumns[i]] = row.values[i];
  }
  m["it_per_s"] = report.steps_done > 0 ? static_cast<double>(report.steps_done) / seconds : std::nan("");
  m["wall_s"] = wall_s();
  result.outputs = files.Outputs();
  if (report.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back(
        {"AVA-NONFINITE", report.message, "resume with a smaller --learning-rate from the saved checkpoint"});
  }
  return result;
}

void FillCommon(const RunConfig& config, const RunPacks& packs, const std::string& folder, CommandResult* result) {
  result->folder = folder;
  result->inputs = {config.dataset};
  result->metrics["train"] = {{"cameras", config.split.train_cameras.size()},
                              {"frames", config.split.train_frames.size()},
                              {"images", packs.train.size()},
                              {"template_iou", config.template_iou}};
  if (!packs.skipped.empty()) {
    result->warnings.push_back(
        {"AVA-SKIPPED", std::to_string(packs.skipped.size()) + " pictures were left out; the first: " + packs.skipped.front(),
         "check these pictures, masks and joints"});
    if (result->exit == kExitOk) result->exit = kExitPartial;
  }
  std::ostringstream text;
  const auto& m = result->metrics;
  text << "avatar (" << m["method"].get<std::string>() << ", " << m["num_parameters"] << " parameters) trained on "
       << packs.train.size() << " pictures of " << config.split.train_cameras.size() << " cameras: " << m["steps"]
       << " steps in " << std::llround(m["wall_s"].get<double>()) << " s\n  " << folder << "\n";
  result->text = text.str();
}

/// The net of the perceptual loss, null for none. What "auto" became is kept, so that a run goes on with the same.
std::shared_ptr<const avatar::FeatureNet> PerceptualNet(avatar::TrainOptions* options) {
  if (options->weight_perceptual == 0) options->perceptual = "none";
  const auto net = avatar::FeatureNetByName(options->perceptual);
  if (options->perceptual == "auto") options->perceptual = net ? net->name() : "none";
  return net;
}

CommandResult RunTrain(const TrainArguments& arguments, CommandContext& context) {
  Validate(arguments.model);
  Validate(arguments.train);
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(arguments.dataset);
  RunConfig config;
  config.dataset = std::filesystem::absolute(arguments.dataset).lexically_normal().string();
  config.pack = arguments.pack;
  config.pack.person = avatar::ChoosePerson(data, arguments.pack.person);
  const std::vector<int> frames =
      arguments.holdout_frames.empty() ? std::vector<int>() : ParseRanges("--holdout-frames", arguments.holdout_frames);
  config.split = avatar::SplitDataset(data, config.pack.person, SplitCommas(arguments.holdout_cameras), frames,
                                      SplitCommas(arguments.train_cameras));
  AvatarRun files(arguments.out);
  files.Prepare(arguments.overwrite);
  const RunPacks packs = BuildPacks(data, arguments.train.validate_pictures, context.run, &config);
  WriteRunConfig(config, files.Path(avatar::kRunConfigFile));
  avatar::TrainOptions options = arguments.train;
  const auto net = PerceptualNet(&options);
  avatar::Trainer trainer(packs.train, arguments.model, options, context.run, net);
  CommandResult result = TrainAndSave(trainer, files, packs, options, 0, context);
  FillCommon(config, packs, arguments.out, &result);
  return result;
}

CommandResult RunResume(const ResumeArguments& arguments, CommandContext& context) {
  AvatarRun files(arguments.run);
  RunConfig config = avatar::ReadRunConfig(files.Path(avatar::kRunConfigFile));
  const avatar::TensorFile checkpoint = avatar::ReadTensorFile(files.checkpoint_path());
  avatar::TrainOptions options = avatar::TrainOptionsFrom(checkpoint, files.checkpoint_path());
  if (arguments.steps >= 0) options.steps = arguments.steps;
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(config.dataset);
  config.pack.shape = config.shape, config.pack.half_extent_m = config.half_extent_m, config.pack.fit_shape = false;
  const RunPacks packs = BuildPacks(data, options.validate_pictures, context.run, &config);
  avatar::Trainer trainer(packs.train, checkpoint, files.checkpoint_path(), options, context.run, PerceptualNet(&options));
  const int64_t before = trainer.model().step;
  const double earlier_s = files.TakeUpHistory(before);
  CommandResult result = TrainAndSave(trainer, files, packs, options, earlier_s, context);
  FillCommon(config, packs, arguments.run, &result);
  result.metrics["resumed_from"] = before;
  if (trainer.model().step == before) {
    result.warnings.push_back(
        {"AVA-NOTHING-TO-DO", "all " + std::to_string(before) + " steps are done", "ask for more with --steps"});
  }
  return result;
}

CommandResult RunInfo(const std::string& run, const avatar::ModelOptions& asked) {
  CommandResult result;
  avatar::ModelOptions options = asked;
  if (!run.empty()) {
    const avatar::AvatarModel model = avatar::LoadModel(AvatarRun(run).checkpoint_path());
    options = model.options;
    result.metrics["steps"] = model.step;
    result.metrics["size_px"] = model.size_px;
    result.inputs = {run};
  }
  Validate(options);
  const int64_t texels = options.method == "tna" ? int64_t{24} * 3 * options.texture_px * options.texture_px : 0;
  result.metrics["num_parameters"] = avatar::NumParameters(options);
  result.metrics["num_texels"] = texels;
  for (const auto& [name, value] : FieldsAsText(options)) result.metrics["model"][name] = value;
  result.text = "network: " + std::to_string(result.metrics["num_parameters"].get<int64_t>()) +
                " parameters; textures: " + std::to_string(texels) + " numbers\n";
  return result;
}

void RegisterTrain(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<TrainArguments>();
  CLI::App* sub = avatar.add_subcommand("train", "Train an avatar on a Panoptic-style dataset with masks");
  sub->add_option("dataset", a->dataset, "dataset folder")->required();
  sub->add_option("--out", a->out, "folder of the run")->required();
  sub->add_option("--train-cameras", a->train_cameras,
                  "cameras to train on, e.g. cam_00,cam_04; all that are not held out unless given");
  sub->add_option("--holdout-cameras", a->holdout_cameras,
                  "cameras never trained on, e.g. cam_02,cam_05 (Panoptic or studio names)");
  sub->add_option("--holdout-frames", a->holdout_frames, "frames never trained on, e.g. 80-99");
  sub->add_flag("--overwrite", a->overwrite, "replace an older run in --out");
  AddOptions(sub, a->model);
  AddOptions(sub, a->train);
  AddOptions(sub, a->pack);
  registry.Add(sub, "avatar train", [a](CommandContext& context) { return RunTrain(*a, context); });
}

}  // namespace

void RegisterAvatarTrain(CLI::App& avatar, Registry& registry) {
  RegisterTrain(avatar, registry);
  auto resume = std::make_shared<ResumeArguments>();
  CLI::App* again = avatar.add_subcommand("resume", "Continue an interrupted or finished training run");
  again->add_option("run", resume->run, "folder of the run")->required();
  again->add_option("--steps", resume->steps,
                    "end-to-end steps in all, counted from the beginning of the run; -1: as asked for then");
  registry.Add(again, "avatar resume", [resume](CommandContext& context) { return RunResume(*resume, context); });

  auto options = std::make_shared<avatar::ModelOptions>(avatar::PaperModel());
  auto run = std::make_shared<std::string>();
  CLI::App* info = avatar.add_subcommand("info", "Size of a network (defaults: the published one) or of a trained run");
  info->add_option("run", *run, "folder of a run; without it the options below are used");
  AddOptions(info, *options);
  registry.Add(info, "avatar info", [run, options](CommandContext&) { return RunInfo(*run, *options); });
}

}  // namespace mvstudio::cli
