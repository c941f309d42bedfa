#include <ATen/ATen.h>

#include <optional>
#include <utility>

#include "avatar/nets/sequence.h"
#include "avatar/run/evaluate/baselines.h"
#include "avatar/run/evaluate/posenet_features.h"
#include "avatar/run/references/body_textures.h"
#include "avatar/scores/image_scores.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/log.h"
#include "stages/nets/pretrain_input.h"
#include "stages/nets/train/method.h"
#include "stages/nets/train/start.h"

namespace mvstudio::stages {
namespace {

/// Images of the final score must not choose: without validation images the network is not judged.
void SettleGain(bool given, const avatar::DatasetSplit& split, avatar::TrainOptions* options) {
  const bool judged = !split.validation_cameras.empty() && options->validate_images > 0;
  if (!judged && given && options->least_gain > 0)
    throw UsageError(
        "option 'least-gain' needs option 'validate-camera' or a option 'split' with validation images, and option "
        "'validate-pictures' above 0");
  if (!judged) options->least_gain = 0;
}

/// SSIM of each image in the mask's box, as `avatar eval` has it.
std::vector<double> ScoresOf(avatar::Trainer& trainer, const avatar::AvatarPack& images) {
  std::vector<double> ssim;
  trainer.UseHanded([&](avatar::AvatarModel& model) {
    const avatar::RenderedPack rendered = avatar::RenderPack(model, images, 4);
    for (const metrics::ImageScore& score :
         avatar::ScoreImages(avatar::EightBit(avatar::OnBlack(images)), images.masks, avatar::EightBit(rendered.images),
                             rendered.masks.to(at::kDouble)))
      ssim.push_back(score.bbox.ssim);
  });
  return ssim;
}

/// Networks: tna, direct, v2v and hf.
class NetworkMethod : public TrainingMethod {
 public:
  explicit NetworkMethod(const AvatarTrainOptions& options) : options_(options) {
    VisitConstFields(
        [&](const std::string& name, const auto&, const std::string&) {
          if (options.Given(name)) throw UsageError("option '" + name + "' needs option 'method' gaussians");
        },
        avatar::GaussianOptions{});
    train = options.train;
    Validate(train);
    avatar::ResolveDevice(train.device);
    from_ = StartOf(options);
    model = ModelOf(options, from_);
  }

  void Prepare(avatar::RunConfig* config) override {
    if (!config->pack.iuv.empty()) config->pack.iuv = PathOnDisk(config->pack.iuv);
    config->pack.num_joints = avatar::LayoutOf(model.inputs).num_joints;
    config->pack.template_input_px = model.prior == avatar::Prior::kTemplate ? config->pack.size_px : 0;
    if (!config->pack.pose3d.empty()) config->pack.pose3d = PathOnDisk(config->pack.pose3d);
    SettleGain(options_.Given("least-gain"), config->split, &train);
    body_alone_ = TakesBodyAlone();
    if (!body_alone_) return;
    train.steps = train.init_steps = 0;
    Log(LogLevel::kWarning,
        "no network is trained: a body is fitted and coloured (option 'validate-camera' NAME trains one, too)");
  }

  void Train(const TrainingPlace& place, const RunContext& run, AvatarTrainReport* report) override {
    if (from_) report->seen = SeenPoses(options_.init_from, place.config);
    avatar::Trainer trainer = MakeTrainer(place.config, place.packs, run, &report->start);
    report->body_alone = body_alone_;
    TrainNetwork(trainer, train, place, 0, run, report);
    if (options_.budget.Asked() && place.team.first()) report->judged_ssim = ScoresOf(trainer, *place.packs.watched);
  }

  MethodTrial Try(const avatar::RunConfig& config, const RunPacks& packs, const RunContext& run) override {
    MethodTrial trial;
    const double begin_s = SecondsNow();
    std::optional<NetworkStart> start;
    avatar::Trainer trainer = MakeTrainer(config, packs, run, &start);
    trainer.Run(nullptr, {});
    const double trained_s = SecondsNow();
    trial.ssim = ScoresOf(trainer, *packs.watched);
    trial.seconds = trained_s - begin_s, trial.scoring_s = SecondsNow() - trained_s;
    return trial;
  }

 private:
  avatar::Trainer MakeTrainer(const avatar::RunConfig& config, const RunPacks& packs, const RunContext& run,
                              std::optional<NetworkStart>* began) {
    const auto net = PerceptualNet(&train);
    std::optional<avatar::StartNetwork> start;
    if (from_) {
      start = StartFrom(*from_, model, packs.train.size_px, run.seed);
      *began = {options_.init_from, from_->options.method, start->taken, start->partly, start->fresh};
    }
    avatar::Trainer trainer = start ? avatar::Trainer(packs.train, std::move(*start), train, run, net)
                                    : avatar::Trainer(packs.train, model, train, run, net);
    if (model.method == avatar::Method::kHf) trainer.SetBodyTextures(avatar::TexturesToTensor(config.pack.fitted->textures));
    return trainer;
  }

  /// Whether there is no network: nobody asked for one, and nothing can show that it adds to the fitted body.
  bool TakesBodyAlone() const {
    const bool fitted = options_.fit == BodyFitMode::kAuto && model.prior == avatar::Prior::kTemplate;
    return fitted && model.method == avatar::Method::kTna && train.least_gain == 0 && options_.init_from.empty() &&
           !options_.Given("steps") && !options_.Given("init-steps") && !options_.Given("least-gain");
  }

  const AvatarTrainOptions& options_;
  std::optional<avatar::AvatarModel> from_;
  bool body_alone_ = false;
};

/// Returns when the first rank has come here: where one process ends, schedulers may end the others.
void WaitForFirst(const avatar::Ranks* ranks) {
  at::Tensor nothing = at::zeros({1});
  if (ranks) ranks->Broadcast(nothing);
}

/// Trains to the end with checkpoints on the way. A request to stop saves first. Only the first rank writes files. `ranks`:
/// nullptr for one process.
avatar::TrainReport TrainAndSave(avatar::Trainer& trainer, const avatar::TrainOptions& options, const TrainingPlace& place,
                                 double earlier_s, const avatar::Ranks* ranks, const RunContext& run) {
  const double start_s = SecondsNow();
  AvatarRun* files = place.team.first() ? &place.files : nullptr;
  const avatar::AvatarPack* watched = place.packs.watched ? &*place.packs.watched : nullptr;
  const avatar::AvatarPack& samples = watched ? *watched : place.packs.train;
  ProgressStage stage(run, "training", trainer.total_steps() - trainer.model().step);
  bool stopped = false;
  bool begun = false;
  const auto callback = [&](int64_t step, const avatar::HistoryRow* row) {
    if (files && !std::exchange(begun, true)) files->ForgetScores();
    if (row && files) files->AddRow(*row, earlier_s + SecondsNow() - start_s);
    if (row && row->phase == "validation") return true;
    if (files && step % options.save_every == 0) files->Save(trainer, samples);
    if (files && options.image_every > 0 && step % options.image_every == 0) files->SaveImage(trainer, samples);
    stopped = run.progress && run.progress->Cancelled();
    if (!stopped) stage.Advance(1, row ? row->phase + " loss " + std::to_string((*row)["total"]) : "");
    return !stopped;
  };
  avatar::TrainReport report = trainer.Run(watched, callback);
  if (files) files->Save(trainer, samples);
  if (report.stopped) {
    WaitForFirst(ranks);
    throw CancelledError("interrupted after step " + std::to_string(trainer.model().step) +
                         ": the checkpoint is saved, `mvstudio avatar resume` goes on");
  }
  return report;
}

}  // namespace

std::unique_ptr<TrainingMethod> MakeNetworkMethod(const AvatarTrainOptions& options) {
  return std::make_unique<NetworkMethod>(options);
}

std::shared_ptr<const avatar::FeatureNet> PerceptualNet(avatar::TrainOptions* options) {
  if (options->weight_perceptual == 0) options->perceptual = "none";
  const auto net = avatar::FeatureNetByName(options->perceptual);
  if (options->perceptual == "auto") options->perceptual = net ? net->name() : "none";
  return net;
}

void TrainNetwork(avatar::Trainer& trainer, const avatar::TrainOptions& options, const TrainingPlace& place, double earlier_s,
                  const RunContext& run, AvatarTrainReport* report) {
  const double start_s = SecondsNow();
  const RankTeam& team = place.team;
  const auto joined = team.join ? team.join() : nullptr;
  if (joined) trainer.Join(joined);
  if (place.begin && team.first()) place.begin();
  NetworkTrained trained;
  trained.report = TrainAndSave(trainer, options, place, earlier_s, joined.get(), run);
  if (!team.first()) return;
  if (team.finish) team.finish();
  trained.seconds = SecondsNow() - start_s;
  trained.device = trainer.device(), trained.ranks = team.size, trained.least_gain = options.least_gain;
  report->method = trainer.model().options.method, report->steps = trainer.model().step;
  if (report->steps > 0) report->num_parameters = avatar::NumParameters(trainer.model().options);  // else textures alone
  report->wall_s = earlier_s + trained.seconds;
  report->network = std::move(trained);
}

}  // namespace mvstudio::stages
