#include "stages/nets/renderer_pretrain.h"

#include <algorithm>
#include <iterator>
#include <optional>

#include "avatar/nets/transfer.h"
#include "avatar/run/references/body_textures.h"
#include "avatar/train/train.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/stopwatch.h"
#include "stages/nets/avatar_run.h"
#include "stages/nets/avatar_train_data.h"
#include "stages/nets/pretrain_input.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

constexpr std::string_view kUsed[] = {"batch",        "learning-rate",     "texture-learning-rate",
                                      "decay-share",  "clip-norm",         "weight-l1",
                                      "weight-ssim",  "weight-gradient",   "weight-mask",
                                      "weight-logit", "foreground-weight", "jitter-scale",
                                      "jitter-shift", "jitter-roll-deg",   "device"};

/// A person to learn from.
struct Subject {
  avatar::RunConfig config;
  avatar::ModelOptions model;
};

Subject ReadRun(const std::string& folder) {
  Subject subject;
  subject.config = avatar::OpenRun(folder, "");
  const std::string path = folder + "/" + avatar::kCheckpointFile;
  subject.model = ModelOptionsFrom(avatar::ReadTensorFile(path), path);
  if (subject.model.method != avatar::Method::kHf)
    throw UsageError(folder + ": is a run of method " + std::string(ToString(subject.model.method)) +
                     "; give runs of option 'method' hf");
  return subject;
}

/// Textures and the choice of references may differ, layers must not.
void RequireSameNetwork(const Subject& first, const Subject& other, const std::vector<std::string>& runs, size_t i) {
  const auto a = FieldsAsText(first.model), b = FieldsAsText(other.model);
  for (size_t k = 0; k < a.size(); ++k) {
    const std::string& name = a[k].first;
    const bool shapes = name != "texture-px" && name.rfind("reference", 0) != 0;
    if (shapes && a[k].second != b[k].second)
      throw UsageError(runs[i] + ": option '" + name + "' is " + b[k].second + ", that of " + runs[0] + " is " + a[k].second);
  }
  if (TakesReferences(first.model) != TakesReferences(other.model))
    throw UsageError(runs[i] + ": of it and " + runs[0] + " one takes references and one does not");
}

avatar::Trainer TrainerOf(const std::string& folder, Subject* subject, const avatar::TrainOptions& options,
                          const RunContext& run) {
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(subject->config.dataset);
  const RunPacks packs =
      BuildPacks(data, subject->model, options, run, &subject->config, ReadReferences(folder, subject->config, subject->model));
  avatar::Trainer trainer(packs.train, subject->model, options, run);
  trainer.SetBodyTextures(avatar::TexturesToTensor(subject->config.pack.fitted->textures));
  return trainer;
}

/// Each in turn makes a step of the network that they share. Returns the last report.
avatar::TrainReport TakeTurns(std::vector<avatar::Trainer>& trainers, int64_t steps, const RunContext& run) {
  ProgressStage stage(run, "training a renderer", steps);
  avatar::TrainReport report;
  for (int64_t step = 0; step < steps; ++step) {
    const size_t own = static_cast<size_t>(step) % trainers.size();
    if (step > 0 && trainers.size() > 1) trainers[own].TakeNetwork(trainers[(own + trainers.size() - 1) % trainers.size()]);
    report = trainers[own].Run(nullptr, {}, trainers[own].model().step + 1);
    if (report.status != Status::kOk) return report;
    if (run.progress && run.progress->Cancelled()) throw CancelledError("interrupted: nothing was written");
    stage.Advance();
  }
  return report;
}

nlohmann::ordered_json Sources(const std::vector<Subject>& subjects) {
  auto list = nlohmann::ordered_json::array();
  for (const Subject& subject : subjects)
    list.push_back({{"path", subject.config.dataset},
                    {"kind", "dataset"},
                    {"frames", RangesText(subject.config.split.train_frames)},
                    {"cameras", subject.config.split.train_cameras}});
  return list;
}

/// The renderer with no one's textures.
void Save(const avatar::AvatarModel& trained, const std::vector<Subject>& subjects, const AvatarRun& files, uint64_t seed) {
  const avatar::AvatarModel bare = avatar::StartFrom(trained, subjects.front().model, trained.size_px, seed).model;
  const nlohmann::ordered_json state = {{"schema", "mvstudio.avatar-pretraining/1"},
                                        {"arguments_sha256", "none: a renderer of several people"},
                                        {"finished", false},
                                        {"seed", seed},
                                        {"sources", Sources(subjects)}};
  files.Clear();
  FilesTogether together;
  WriteFileAtomic(files.Path(kPretrainFile), state.dump(1) + "\n");
  avatar::WriteTensorFile(ModelToTensors(bare), files.checkpoint_path());
  together.Commit();
}

}  // namespace

bool IsOfRenderers(std::string_view option) { return std::find(std::begin(kUsed), std::end(kUsed), option) != std::end(kUsed); }

CommandResult PretrainRenderer(const RendererPretraining& arguments, const std::string& folder, bool overwrite,
                               const RunContext& run) {
  const Stopwatch watch;
  if (arguments.runs.empty()) throw UsageError("give the runs of the people to learn from");
  avatar::Validate(arguments.train);
  avatar::ResolveDevice(arguments.train.device);
  std::vector<Subject> subjects;
  for (size_t i = 0; i < arguments.runs.size(); ++i) {
    subjects.push_back(ReadRun(arguments.runs[i]));
    RequireSameNetwork(subjects.front(), subjects.back(), arguments.runs, i);
  }
  const AvatarRun files(folder);
  const OutputFolder place(folder, arguments.runs, AvatarRun::Names());
  files.RequireFree(overwrite);
  avatar::TrainOptions options = arguments.train;
  const auto people = static_cast<int>(subjects.size());
  options.steps = (options.steps + people - 1) / people, options.init_steps = 0;
  options.validate_images = 0, options.least_gain = 0, options.perceptual = "none";
  std::vector<avatar::Trainer> trainers;
  for (size_t i = 0; i < subjects.size(); ++i) trainers.push_back(TrainerOf(arguments.runs[i], &subjects[i], options, run));
  const int64_t steps = int64_t{options.steps} * people;
  const avatar::TrainReport report = TakeTurns(trainers, steps, run);
  CommandResult result;
  result.folder = folder, result.inputs = arguments.runs;
  if (report.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"AVA-NONFINITE", report.message, "train again with a smaller option 'learning-rate'"});
    return result;
  }
  Save(trainers.back().model(), subjects, files, run.seed);
  const double wall_s = watch.Seconds();
  result.metrics = {{"people", people},
                    {"steps", steps},
                    {"num_parameters", avatar::NumParameters(subjects.front().model)},
                    {"sources", Sources(subjects)},
                    {"wall_s", wall_s}};
  result.outputs = {{files.checkpoint_path(), "checkpoint"}, {files.Path(kPretrainFile), "pretraining"}};
  result.text = Format("renderer of %d people: %lld steps in %.0f s\n  %s\n", people, static_cast<long long>(steps), wall_s,
                       folder.c_str());
  return result;
}

}  // namespace mvstudio::stages
