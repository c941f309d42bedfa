#include "stages/nets/train/run.h"

#include <filesystem>
#include <optional>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "stages/nets/body_motion.h"
#include "stages/nets/train/budget.h"
#include "stages/nets/train/method.h"

namespace mvstudio::stages {
namespace {

using avatar::RunConfig;

/// The person's own body into `config`, where the options ask for one: read, or fitted. Labels of DensePose have no use for it.
std::optional<avatar::PersonFit> FitFor(const AvatarTrainOptions& options, const dataset::PanopticDataset& data,
                                        const RunContext& run, RunConfig* config) {
  config->pack.fit_shape = options.fit == BodyFitMode::kGirths && config->pack.fit_shape;
  if (options.fit != BodyFitMode::kAuto || !config->pack.iuv.empty()) {
    for (const char* option : {"template", "body"}) {
      if (options.Given(option))
        throw UsageError("option '" + std::string(option) +
                         "' needs a body that is fitted: option 'fit' auto, and no option 'iuv'");
    }
    return std::nullopt;
  }
  config->body_file = body::kPersonFileName;
  if (!options.body.empty()) {
    if (options.Given("template")) throw UsageError("option 'body' is fitted already: leave option 'template' out");
    config->pack.fitted =
        std::make_shared<const body::TexturedPerson>(BodyForSplit(options.body, config->split, config->pack.pose_by));
    return std::nullopt;
  }
  avatar::PersonFitOptions fit_options;
  fit_options.templates = TemplatesOf(options.body_template);
  avatar::PersonFit fit = FitToSplit(data, config->split, config->pack.person, config->pack.pose_by, fit_options, run);
  config->pack.fitted = std::make_shared<const body::TexturedPerson>(fit.result);
  return fit;
}

/// Where files lie says who works where; relative to the run they can be found as well.
RunConfig WithRelativePaths(RunConfig config, const std::string& run) {
  for (std::string* path : {&config.dataset, &config.pack.pose3d, &config.pack.iuv}) {
    if (!path->empty()) *path = std::filesystem::path(*path).lexically_relative(PathOnDisk(run)).string();
  }
  return config;
}

/// The dataset, crop, person and split of a run.
RunConfig ConfigOf(const AvatarTrainOptions& options, const dataset::PanopticDataset& data) {
  RunConfig config;
  config.dataset = PathOnDisk(options.dataset);
  config.pack = options.pack;
  config.pack.person = avatar::ChoosePerson(data, options.pack.person);
  config.split = SplitOf(data, config.pack.person, options.split);
  return config;
}

/// Removes an older run, and writes what a new one begins with.
void BeginRun(const RunConfig& config, const avatar::References* references, const AvatarTrainOptions& options,
              const AvatarRun& files) {
  files.Clear();
  if (references) WriteReferenceViews(references->views(), files.Path(avatar::kReferencesFile));
  if (config.pack.fitted) {
    WritePerson(*config.pack.fitted, files.Path(body::kPersonFileName));
    const std::string motion = BodyMotion(config.pack.fitted->person);
    const std::string colours = motion.empty() ? "" : BodyTexture(*config.pack.fitted);
    if (!motion.empty()) WriteFileAtomic(files.Path(kBodyMotionFile), motion);
    if (!colours.empty()) WriteFileAtomic(files.Path(kBodyTextureFile), colours);
  }
  WriteRunConfig(options.relative_paths ? WithRelativePaths(config, options.out) : config, files.Path(avatar::kRunConfigFile));
}

}  // namespace

std::unique_ptr<TrainingMethod> MakeMethod(const AvatarTrainOptions& options) {
  return options.model.method == avatar::Method::kGaussians ? MakeGaussianMethod(options) : MakeNetworkMethod(options);
}

AvatarTrainReport RunAvatarTrain(AvatarTrainOptions options, RunContext run) {
  const double begin_s = SecondsNow(), started_s = options.budget.NowSeconds();
  CheckAvatarBudget(options);
  const bool choose = options.budget.Asked();
  auto method = choose ? nullptr : MakeMethod(options);
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(options.dataset);
  if (choose) LeaveJudgeOut(data, &options);
  RunConfig config = ConfigOf(options, data);
  if (method) method->Prepare(&config);
  AvatarRun files(options.out);
  std::optional<OutputFolder> place;
  if (options.ranks.rank == 0) {
    files.RequireFree(options.overwrite);
    const std::vector<std::string> inputs = {options.dataset, options.pack.iuv, options.pack.pose3d, options.init_from,
                                             options.body};
    place.emplace(options.out, inputs, AvatarRun::Names());
  }
  const RankTeam team = options.ranks.start ? options.ranks.start(1) : RankTeam{};
  if (team.threads > 0) run.num_threads = team.threads;
  AvatarTrainReport report;
  report.rank = team.rank, report.dataset = options.dataset, report.folder = options.out;
  if (options.ranks.rank == 0) report.conflicts = CheckTrainingImages(data, config.split, run);
  if (choose) RequireTimeToFit(data, config, options, started_s, run);
  report.fit = FitFor(options, data, run, &config);
  if (choose) {
    report.budget = ChooseAvatar(data, config, started_s, run, &options);
    method = MakeMethod(options);
    method->Prepare(&config);
  }
  const RunPacks packs = BuildPacks(data, method->model, method->train, run, &config);
  const auto begin = [&] { BeginRun(config, packs.references.get(), options, files); };
  method->Train({config, packs, files, team, begin}, run, &report);
  if (!team.first()) return report;
  FillImages(config, packs, &report);
  if (choose) KeepAvatarBudget(started_s, &report);
  report.outputs = files.Outputs();
  ReportSplitFrames(data, options.split, &report.notes);
  report.masks = data.Masks();
  report.whole_s = SecondsNow() - begin_s;
  return report;
}

void FillImages(const avatar::RunConfig& config, const RunPacks& packs, AvatarTrainReport* report) {
  report->config = config, report->packs = packs, report->images = packs.train.size();
}

}  // namespace mvstudio::stages
