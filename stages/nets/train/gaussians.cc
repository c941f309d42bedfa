#include <ATen/ATen.h>

#include <cmath>

#include "avatar/splats/files/cloud_file.h"
#include "avatar/splats/files/player_file.h"
#include "avatar/splats/files/ply.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/train/method.h"

namespace mvstudio::stages {
namespace {

/// Options of the networks' training that Gaussians have too.
bool IsShared(const std::string& name) {
  for (const char* shared :
       {"method", "steps", "batch", "save-every", "validate-pictures", "weight-l1", "weight-ssim", "weight-mask"})
    if (name == shared) return true;
  return false;
}

std::string HistoryOf(const std::vector<std::string>& rows) {
  std::string text = "degree,step,l1,ssim_loss,mask,total,validation_ssim,validation_psnr_db,gaussians,wall_s\n";
  for (const std::string& row : rows) text += row + "\n";
  return text;
}

std::string RowText(int degree, const splats::TrainRow& row, double wall_s) {
  const auto number = [](double value) { return std::isfinite(value) ? Format("%.6g", value) : std::string(); };
  const auto loss = [&](double value) { return row.step > 0 ? number(value) : std::string(); };  // none before the first step
  return std::to_string(degree) + "," + std::to_string(row.step) + "," + loss(row.loss.l1) + "," + loss(row.loss.ssim) + "," +
         loss(row.loss.mask) + "," + loss(row.loss.total) + "," + number(row.validation_ssim) + "," +
         number(row.validation_psnr_db) + "," + std::to_string(row.gaussians) + Format(",%.2f", wall_s);
}

/// What was asked for, of which runs of one recipe are known.
std::map<std::string, std::string> AskedFor(const avatar::GaussianOptions& gaussians, const splats::TrainOptions& options) {
  std::map<std::string, std::string> out = {{"train.steps", std::to_string(options.steps)},
                                            {"train.batch", std::to_string(options.batch)},
                                            {"train.weight-l1", Format("%.6g", options.weights.l1)},
                                            {"train.weight-ssim", Format("%.6g", options.weights.ssim)},
                                            {"train.weight-mask", Format("%.6g", options.weights.mask)}};
  for (const auto& [name, value] : FieldsAsText(gaussians)) out["model." + name] = value;
  return out;
}

/// The body at each time step that was trained on, in order.
std::vector<splats::PlayerTimeStep> TimeStepsOf(const RunPacks& packs) {
  std::map<int, const Eigen::Matrix3Xf*> by_frame;
  const int64_t* frames = packs.train.frame.data_ptr<int64_t>();
  for (size_t i = 0; i < packs.train_views.size(); ++i)
    by_frame[static_cast<int>(frames[i])] = packs.train_views[i].vertices.get();
  std::vector<splats::PlayerTimeStep> time_steps;
  for (const auto& [frame, vertices] : by_frame) time_steps.push_back({frame, vertices});
  return time_steps;
}

/// What a training leaves.
struct Trained {
  avatar::GaussianTraining learned;
  std::map<std::string, std::string> asked;
  std::vector<std::string> rows;
  std::vector<splats::TrainView> samples;
  double wall_s = 0;
};

void Save(const Trained& trained, const avatar::RunConfig& config, const RunPacks& packs, const AvatarRun& files,
          const RunContext& run) {
  const body::BodyTemplate& body = config.pack.fitted->person.body;
  const splats::TrainResult& result = trained.learned.result;
  const bool mip = trained.learned.options.smooth;
  FilesTogether together;
  WriteFileAtomic(files.Path("history.csv"), HistoryOf(trained.rows));
  dataset::WriteImage(avatar::GaussianSheet(result.cloud, body, trained.samples, mip, run.num_threads),
                      files.Path(Format("samples/step_%06d.png", result.best_step)));
  WritePly(splats::ToPly(result.cloud, body.faces, body.vertices), files.Path(splats::kPlyFileName));
  const std::string player = splats::PlayerBytes(result.cloud, mip, body, TimeStepsOf(packs));
  if (!player.empty()) WriteFileAtomic(files.Path(splats::kPlayerFileName), player);
  splats::WriteCloud({result.cloud, mip, config.pack.size_px, result.best_step, run.seed, trained.wall_s, trained.asked}, body,
                     files.Path(splats::kCloudFileName));
  together.Commit();
}

int64_t NumbersOf(const splats::Cloud& cloud) {
  int64_t count = 0;
  ForEachGroup(cloud.values,
               [&](splats::Group, int, const std::vector<float>& array) { count += static_cast<int64_t>(array.size()); });
  return count;
}

/// Options of networks are not those of Gaussians.
void RefuseNetworkOptions(const AvatarTrainOptions& options) {
  const auto refuse = [&](const std::string& name) {
    if (options.Given(name) && !IsShared(name))
      throw UsageError("option '" + name + "' is of the networks: option 'method' gaussians has none; leave it out");
  };
  const auto field = [&](const std::string& name, const auto&, const std::string&) { refuse(name); };
  VisitConstFields(field, avatar::ModelOptions{});
  VisitConstFields(field, avatar::TrainOptions{});
  for (const char* name :
       {"init-from", "iuv", "pose3d", "fit-shape", "fit-pictures", "ranks", "rank", "world-size", "rendezvous"})
    refuse(name);
}

/// A run of Gaussians: gaussians.npz, gaussians.ply, history.csv and samples beside the configuration. Without validation
/// images the last step is kept.
class GaussianMethod : public TrainingMethod {
 public:
  explicit GaussianMethod(const AvatarTrainOptions& options) : options_(options) {
    RefuseNetworkOptions(options);
    if (options.fit != BodyFitMode::kAuto)
      throw UsageError("option 'method' gaussians needs a body that is fitted: option 'fit' auto, or option 'body'");
    train = options.train;
  }

  void Prepare(avatar::RunConfig* config) override { config->pack.keep_views = true; }

  void Train(const TrainingPlace& place, const RunContext& run, AvatarTrainReport* report) override {
    const RunPacks& packs = place.packs;
    const splats::TrainOptions steps = StepsOf();
    std::vector<splats::TrainView> watched;
    const avatar::GaussianImages images = ImagesOf(place.config, packs, &watched);
    Trained trained;
    trained.asked = AskedFor(options_.gaussians, steps);
    const double start_s = SecondsNow();
    const auto on_row = [&](int degree, const splats::TrainRow& row, const splats::Cloud&) {
      trained.rows.push_back(RowText(degree, row, SecondsNow() - start_s));
    };
    trained.learned =
        avatar::TrainGaussians(*place.config.pack.fitted, images, options_.gaussians.colour_degree, steps, run, on_row);
    trained.wall_s = SecondsNow() - start_s;
    trained.samples = watched.empty() ? images.train : watched;
    place.begin();
    Save(trained, place.config, packs, place.files, run);
    report->method = avatar::Method::kGaussians, report->steps = trained.learned.result.best_step;
    report->num_parameters = NumbersOf(trained.learned.result.cloud), report->wall_s = trained.wall_s;
    if (options_.budget.Asked()) report->judged_ssim = trained.learned.result.validation_ssim;
    report->gaussians = std::move(trained.learned);
  }

  MethodTrial Try(const avatar::RunConfig& config, const RunPacks& packs, const RunContext& run) override {
    const double begin_s = SecondsNow();
    std::vector<splats::TrainView> watched;
    avatar::GaussianTraining learned = avatar::TrainGaussians(*config.pack.fitted, ImagesOf(config, packs, &watched),
                                                              options_.gaussians.colour_degree, StepsOf(), run);
    return {SecondsNow() - begin_s, 0, std::move(learned.result.validation_ssim)};
  }

 private:
  splats::TrainOptions StepsOf() const {
    return TrainOptionsOf(options_.gaussians, train, [&](const std::string& name) { return options_.Given(name); });
  }

  static avatar::GaussianImages ImagesOf(const avatar::RunConfig& config, const RunPacks& packs,
                                         std::vector<splats::TrainView>* watched) {
    avatar::GaussianImages images;
    images.train = avatar::TrainViewsOf(packs.train, packs.train_views);
    const int64_t* camera = packs.train.camera_idx.data_ptr<int64_t>();
    images.camera.assign(camera, camera + packs.train.size());
    if (packs.watched) *watched = avatar::TrainViewsOf(*packs.watched, packs.watched_views);
    if (!config.split.validation_cameras.empty()) images.validation = *watched;
    return images;
  }

  const AvatarTrainOptions& options_;
};

}  // namespace

std::unique_ptr<TrainingMethod> MakeGaussianMethod(const AvatarTrainOptions& options) {
  return std::make_unique<GaussianMethod>(options);
}

}  // namespace mvstudio::stages
