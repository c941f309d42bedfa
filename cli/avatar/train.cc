#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <utility>

#include "avatar/run/evaluate/posenet_features.h"
#include "avatar/run/pack/pack_builder.h"
#include "avatar/run/references/body_textures.h"
#include "cli/avatar/ranks.h"
#include "cli/avatar/start_network.h"
#include "cli/avatar/training.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/redact.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/log.h"
#include "stages/dataset/studio_names.h"
#include "stages/input/mask_notice.h"
#include "stages/nets/avatar_fit.h"
#include "stages/nets/avatar_gaussians.h"
#include "stages/nets/avatar_run.h"
#include "stages/nets/avatar_train_data.h"
#include "stages/nets/pretrain_input.h"

namespace mvstudio::cli {
namespace {

using avatar::AvatarPack;
using avatar::RunConfig;

struct TrainArguments {
  TrainArguments() { start.model.prior = avatar::Prior::kAuto; }
  std::string dataset, out, body, body_template = "mannequin";
  StartArguments start;
  stages::SplitArguments split;
  RankArguments ranks;
  avatar::TrainOptions train;
  avatar::GaussianOptions gaussians;
  avatar::PackOptions pack;
  bool overwrite = false;
};

struct ResumeArguments {
  ResumeArguments() { ranks.ranks = 0; }  // as many as before
  std::string run, device, perceptual;
  int steps = -1, patience = -1;
  RankArguments ranks;
};

/// The net of the perceptual loss, null for none. What "auto" became is kept, so that a run goes on with the same.
std::shared_ptr<const avatar::FeatureNet> PerceptualNet(avatar::TrainOptions* options) {
  if (options->weight_perceptual == 0) options->perceptual = "none";
  const auto net = avatar::FeatureNetByName(options->perceptual);
  if (options->perceptual == "auto") options->perceptual = net ? net->name() : "none";
  return net;
}

/// Images of the final score must not choose: without validation images the network is not judged.
void SettleGain(bool given, const avatar::DatasetSplit& split, avatar::TrainOptions* options) {
  const bool judged = !split.validation_cameras.empty() && options->validate_pictures > 0;
  if (!judged && given && options->least_gain > 0)
    throw UsageError(
        "--least-gain needs --validate-camera or a --split with validation images, and --validate-pictures above 0");
  if (!judged) options->least_gain = 0;
}

/// Whether there is no network: nobody asked for one, and nothing can show that it adds to the fitted body.
bool TakesBodyAlone(const TrainArguments& arguments, const avatar::ModelOptions& model, const avatar::TrainOptions& options) {
  const bool fitted = arguments.start.fit == stages::BodyFitMode::kAuto && model.prior == avatar::Prior::kTemplate;
  return fitted && model.method == avatar::Method::kTna && options.least_gain == 0 && arguments.start.init_from.empty() &&
         !arguments.start.given("steps") && !arguments.start.given("init-steps") && !arguments.start.given("least-gain");
}

/// The person's own body into `config`, where the options ask for one: read, or fitted. Labels of DensePose have no use for it.
std::optional<avatar::PersonFit> FitFor(const TrainArguments& arguments, const dataset::PanopticDataset& data,
                                        const RunContext& run, RunConfig* config) {
  config->pack.fit_shape = arguments.start.fit == stages::BodyFitMode::kGirths && config->pack.fit_shape;
  if (arguments.start.fit != stages::BodyFitMode::kAuto || !config->pack.iuv.empty()) {
    for (const char* option : {"template", "body"}) {
      if (arguments.start.given(option))
        throw UsageError("--" + std::string(option) + " needs a body that is fitted: --fit auto, and no --iuv");
    }
    return std::nullopt;
  }
  config->body_file = body::kPersonFileName;
  if (!arguments.body.empty()) {
    if (arguments.start.given("template")) throw UsageError("--body is fitted already: leave --template out");
    config->pack.fitted =
        std::make_shared<const body::TexturedPerson>(stages::BodyForSplit(arguments.body, config->split, config->pack.pose_by));
    return std::nullopt;
  }
  avatar::PersonFitOptions options;
  options.templates = stages::TemplatesOf(arguments.body_template);
  avatar::PersonFit fit = stages::FitToSplit(data, config->split, config->pack.person, config->pack.pose_by, options, run);
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
RunConfig ConfigOf(const TrainArguments& arguments, const dataset::PanopticDataset& data) {
  RunConfig config;
  config.dataset = PathOnDisk(arguments.dataset);
  config.pack = arguments.pack;
  config.pack.person = avatar::ChoosePerson(data, arguments.pack.person);
  config.split = stages::SplitOf(data, config.pack.person, arguments.split);
  return config;
}

void TellFit(const std::optional<avatar::PersonFit>& fit, const std::vector<Notice>& doubts, CommandResult* result) {
  result->warnings.insert(result->warnings.end(), doubts.begin(), doubts.end());
  if (!fit) return;
  result->metrics["body"] = stages::ToJson(*fit);
  result->Add(stages::JudgeFit(*fit));
}

/// The first of several processes tells.
std::vector<Notice> DoubtsOf(const TrainArguments& arguments, const dataset::PanopticDataset& data,
                             const avatar::DatasetSplit& split, const RunContext& run) {
  if (arguments.ranks.rank != 0) return {};
  return stages::CheckTrainingImages(data, split, run);
}

/// Removes an older run, and writes what a new one begins with.
void BeginRun(const RunConfig& config, const avatar::References* references, const std::string& out,
              const stages::AvatarRun& files) {
  files.Clear();
  if (references) WriteReferenceViews(references->views(), files.Path(avatar::kReferencesFile));
  if (config.pack.fitted) WritePerson(*config.pack.fitted, files.Path(body::kPersonFileName));
  WriteRunConfig(Redacting() ? WithRelativePaths(config, out) : config, files.Path(avatar::kRunConfigFile));
}

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

CommandResult RunGaussians(const TrainArguments& arguments, CommandContext& context) {
  const Clock::time_point begin = Clock::now();
  stages::RefuseNetworkOptions(arguments.start.given);
  if (arguments.start.fit != stages::BodyFitMode::kAuto)
    throw UsageError("--method gaussians needs a body that is fitted: --fit auto, or --body");
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(arguments.dataset);
  RunConfig config = ConfigOf(arguments, data);
  stages::AvatarRun files(arguments.out);
  files.RequireFree(arguments.overwrite);
  const OutputFolder place(arguments.out, {arguments.dataset, arguments.body}, stages::AvatarRun::Names());
  const std::vector<Notice> doubts = DoubtsOf(arguments, data, config.split, context.run);
  const std::optional<avatar::PersonFit> fit = FitFor(arguments, data, context.run, &config);
  config.pack.keep_views = true;
  const stages::RunPacks packs = stages::BuildPacks(data, avatar::ModelOptions{}, arguments.train, context.run, &config);
  const auto clock_s = [] { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); };
  CommandResult result = stages::TrainGaussianRun(
      {arguments.gaussians, arguments.train, arguments.start.given, clock_s}, config, packs, files,
      [&] { BeginRun(config, nullptr, arguments.out, files); }, context.run);
  FillCommon(config, packs, arguments.out, SecondsSince(begin), &result);
  TellFit(fit, doubts, &result);
  stages::TellSplitFrames(data, arguments.split, &result);
  stages::TellMasks(data.Masks(), arguments.dataset + "/masks", &result);
  return result;
}

CommandResult RunTrain(const TrainArguments& arguments, CommandContext& context) {
  const Clock::time_point begin = Clock::now();
  context.camera_names = stages::StudioNames(arguments.dataset);
  if (arguments.start.model.method == avatar::Method::kGaussians) return RunGaussians(arguments, context);
  stages::RefuseGaussianOptions(arguments.start.given);
  Validate(arguments.train);
  avatar::ResolveDevice(arguments.train.device);
  const std::optional<avatar::AvatarModel> from = StartOf(arguments.start);
  const avatar::ModelOptions model = ModelOf(arguments.start, from, !arguments.pack.iuv.empty());
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(arguments.dataset);
  RunConfig config = ConfigOf(arguments, data);
  if (!config.pack.iuv.empty()) config.pack.iuv = PathOnDisk(config.pack.iuv);
  config.pack.num_joints = avatar::LayoutOf(model.inputs).num_joints;
  config.pack.template_input_px = model.prior == avatar::Prior::kTemplate ? config.pack.size_px : 0;
  if (!config.pack.pose3d.empty()) config.pack.pose3d = PathOnDisk(config.pack.pose3d);
  avatar::TrainOptions options = arguments.train;
  SettleGain(arguments.start.given("least-gain"), config.split, &options);
  const bool body_alone = TakesBodyAlone(arguments, model, options);
  if (body_alone) {
    options.steps = options.init_steps = 0;
    Log(LogLevel::kWarning, "no network is trained: a body is fitted and coloured (--validate-camera NAME trains one, too)");
  }
  stages::AvatarRun files(arguments.out);
  std::optional<OutputFolder> place;
  if (arguments.ranks.rank == 0) {
    files.RequireFree(arguments.overwrite);
    place.emplace(arguments.out,
                  std::vector<std::string>{arguments.dataset, arguments.pack.iuv, arguments.pack.pose3d,
                                           arguments.start.init_from, arguments.body},
                  stages::AvatarRun::Names());
  }
  RankProcesses ranks(arguments.ranks, context, arguments.out);
  context.run.num_threads = ranks.threads();
  const std::vector<Notice> doubts = DoubtsOf(arguments, data, config.split, context.run);
  const std::optional<avatar::PersonFit> fit = FitFor(arguments, data, context.run, &config);
  const stages::RunPacks packs = stages::BuildPacks(data, model, options, context.run, &config);
  const auto net = PerceptualNet(&options);
  std::optional<avatar::StartNetwork> start;
  std::optional<Notice> seen;
  if (from) seen = stages::SeenPoses(arguments.start.init_from, config);
  if (from) start = StartFrom(*from, model, packs.train.size_px, context.run.seed);
  avatar::Trainer trainer = start ? avatar::Trainer(packs.train, *start, options, context.run, net)
                                  : avatar::Trainer(packs.train, model, options, context.run, net);
  if (model.method == avatar::Method::kHf) trainer.SetBodyTextures(avatar::TexturesToTensor(config.pack.fitted->textures));
  const auto replace_older = [&] { BeginRun(config, packs.references.get(), arguments.out, files); };
  CommandResult result = TrainHere(trainer, files, packs, options, 0, ranks, context, replace_older);
  if (!ranks.first()) return result;
  FillCommon(config, packs, arguments.out, SecondsSince(begin), &result);
  if (start) TellStart(arguments.start, *from, *start, &result);
  if (seen) result.warnings.push_back(*seen);
  if (body_alone)
    result.text +=
        "no network: textured networks have added less than 0.01 of SSIM to fitted bodies, and no validation images are there "
        "to show that this one adds more (--validate-camera NAME trains and judges one, --steps 600 trains one)\n";
  TellFit(fit, doubts, &result);
  stages::TellSplitFrames(data, arguments.split, &result);
  stages::TellMasks(data.Masks(), arguments.dataset + "/masks", &result);
  return result;
}

/// A checkpoint from elsewhere must not choose code that is run: a TorchScript file is named on the command line.
void SettlePerceptual(const ResumeArguments& arguments, const std::string& path, avatar::TrainOptions* options) {
  const std::string& then = options->perceptual;
  const bool file = then != "none" && then != "auto" && then != "posenet" && options->weight_perceptual != 0;
  if (!arguments.perceptual.empty()) {
    options->perceptual = arguments.perceptual;
  } else if (file) {
    throw UsageError(path + ": was trained with the TorchScript file '" + then +
                     "', and such a file is a program: give it as --perceptual FILE");
  }
}

RankArguments RanksOf(const ResumeArguments& arguments, const avatar::TensorFile& checkpoint, const std::string& path) {
  RankArguments ranks = arguments.ranks;
  if (ranks.ranks == 0) ranks.ranks = ranks.world_size > 1 || ranks.rank > 0 ? 1 : RanksFrom(checkpoint, path);
  return ranks;
}

CommandResult RunResume(const ResumeArguments& arguments, CommandContext& context) {
  const Clock::time_point begin = Clock::now();
  if (!arguments.device.empty()) avatar::ResolveDevice(arguments.device);
  if (avatar::HoldsGaussians(arguments.run))
    throw UsageError(arguments.run +
                     " holds Gaussians, which cannot be resumed: train them again with --overwrite and more --steps");
  stages::AvatarRun files(arguments.run);
  RunConfig config = avatar::ReadRunConfig(files.Path(avatar::kRunConfigFile));
  context.camera_names = stages::StudioNames(config.dataset);
  const avatar::TensorFile checkpoint = avatar::ReadTensorFile(files.checkpoint_path());
  avatar::TrainOptions options = avatar::TrainOptionsFrom(checkpoint, files.checkpoint_path());
  if (arguments.steps >= 0) options.steps = arguments.steps;
  if (arguments.patience >= 0) options.patience = arguments.patience;
  if (!arguments.device.empty()) options.device = arguments.device;
  avatar::ResolveDevice(options.device);  // which the run may have had on another machine
  SettlePerceptual(arguments, files.checkpoint_path(), &options);
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(config.dataset);
  std::optional<OutputFolder> place;
  if (arguments.ranks.rank == 0)
    place.emplace(arguments.run, std::vector<std::string>{config.dataset}, stages::AvatarRun::Names());
  config.pack.shape = config.shape, config.pack.half_extent_m = config.half_extent_m, config.pack.fit_shape = false;
  RankProcesses ranks(RanksOf(arguments, checkpoint, files.checkpoint_path()), context, arguments.run);
  context.run.num_threads = ranks.threads();
  const avatar::ModelOptions model = ModelOptionsFrom(checkpoint, files.checkpoint_path());
  const stages::RunPacks packs =
      stages::BuildPacks(data, model, options, context.run, &config, ReadReferences(arguments.run, config, model));
  avatar::Trainer trainer(packs.train, checkpoint, files.checkpoint_path(), options, context.run, PerceptualNet(&options));
  const int64_t before = trainer.model().step;
  const double earlier_s = ranks.first() ? files.ContinueHistory(before) : 0;
  CommandResult result = TrainHere(trainer, files, packs, options, earlier_s, ranks, context);
  if (!ranks.first()) return result;
  FillCommon(config, packs, arguments.run, SecondsSince(begin), &result);
  result.metrics["resumed_from"] = before;
  if (trainer.model().step == before) {
    result.warnings.push_back({"AVA-NOTHING-TO-DO", "all " + std::to_string(before) + " steps are done, or --patience was over",
                               "ask for more with --steps or --patience"});
  }
  return result;
}

CommandResult RunInfo(const std::string& run, const avatar::ModelOptions& asked) {
  if (!run.empty() && avatar::HoldsGaussians(run))
    throw UsageError(run + " holds Gaussians, not a network: their number is in avatar_train.result.json");
  CommandResult result;
  avatar::ModelOptions options = asked;
  if (!run.empty()) {
    const avatar::AvatarModel model = avatar::LoadModel(stages::AvatarRun(run).checkpoint_path());
    options = model.options;
    result.metrics["steps"] = model.step;
    result.metrics["size_px"] = model.size_px;
    result.inputs = {run};
  }
  Validate(options);
  const int channels = options.method == avatar::Method::kTna  ? 3
                       : options.method == avatar::Method::kHf ? options.neural_channels
                                                               : 0;
  const int64_t texels = int64_t{24} * channels * options.texture_px * options.texture_px;
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
  StartGroup(sub, "Data");
  AddOption(sub, "dataset", a->dataset, "dataset folder")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder of the run")->required();
  AddOptions(sub, a->split);
  AddFlag(sub, "--overwrite", a->overwrite, "replace an older run in --out");
  StartGroup(sub, "Network");
  AddOption(
      sub, "--init-from", a->start.init_from,
      "a run, or a folder of `avatar pretrain`, whose network is the start (its options hold, but for --method); textures "
      "are averaged from the new images, and there is no initialisation unless --init-steps asks for one");
  StartGroup(sub, "Body");
  AddChoice(sub, "--fit", a->start.fit,
            "body that maps and labels show: auto fits skeleton, surface and colours to the training images; girths scales the "
            "mannequin's four girths; off takes it as it is");
  AddOption(sub, "--template", a->body_template,
            "body that --fit auto takes, as in `avatar fit`: mannequin, a path, several, auto");
  AddOption(sub, "--body", a->body,
            "body.npz of `avatar fit` or of another run, or its folder, in place of a new fit; it must have been fitted to "
            "training images of this split alone");
  AddOptions(sub, a->start.model);
  AddOptions(sub, a->train);
  AddOptions(sub, a->gaussians);
  AddOptions(sub, a->pack);
  StartGroup(sub, "Machine");
  AddRankOptions(sub, a->ranks);
  a->start.given = [sub](const std::string& name) { return sub->count("--" + name) > 0; };
  registry.Add(sub, "avatar train", [a](CommandContext& context) { return RunTrain(*a, context); });
}

}  // namespace

void RegisterAvatarTrain(CLI::App& avatar, Registry& registry) {
  RegisterTrain(avatar, registry);
  auto resume = std::make_shared<ResumeArguments>();
  CLI::App* again = avatar.add_subcommand("resume", "Continue an interrupted or finished training run");
  AddOutput(again, "run", resume->run, OutputKind::kFolder, "folder of the run")->required();
  AddOption(again, "--steps", resume->steps,
            "end-to-end steps in all, counted from the beginning of the run; -1: as asked for then");
  AddOption(again, "--patience", resume->patience,
            "checkpoints without a better score after which training ends; -1: as asked for then")
      ->capture_default_str();
  AddOption(again, "--perceptual", resume->perceptual,
            "the TorchScript file of the perceptual loss, where one was used: it is run, so a checkpoint alone cannot name it");
  AddOption(again, "--device", resume->device, "auto, cpu or cuda; as asked for then unless given");
  AddRankOptions(again, resume->ranks);
  again->get_option("--ranks")->description("processes on this machine, as in `avatar train`; 0: as many as before");
  registry.Add(again, "avatar resume", [resume](CommandContext& context) { return RunResume(*resume, context); });

  auto options = std::make_shared<avatar::ModelOptions>(avatar::PaperModel());
  auto run = std::make_shared<std::string>();
  CLI::App* info = avatar.add_subcommand("info", "Size of a network (defaults: the published one) or of a trained run");
  AddOption(info, "run", *run, "folder of a run; without it the options below are used");
  AddOptions(info, *options);
  registry.Add(info, "avatar info", [run, options](CommandContext&) { return RunInfo(*run, *options); });
}

}  // namespace mvstudio::cli
