#include "avatar/io/evaluate.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "avatar/io/baselines.h"
#include "avatar/io/posenet_features.h"
#include "avatar/io/strips.h"
#include "avatar/model.h"
#include "avatar/picture_scores.h"
#include "avatar/sequence.h"
#include "core/error.h"
#include "core/files.h"
#include "core/parallel.h"
#include "dataset/image_io.h"

namespace mvstudio::avatar {
namespace {

using metrics::PictureScore;

namespace fs = std::filesystem;

constexpr char kConvention[] =
    "Truth: the dataset's picture on black behind its mask. Render: on black behind its own predicted mask. Crops as in "
    "training, 8-bit sRGB, "
    "RGB in [0, 1]. Primary region: bounding box of the true mask grown by 5 %; also given: full (the whole crop) and masked "
    "(pixels of the "
    "true mask). SSIM: Wang 2004, Gaussian 11x11 sigma 1.5, K 0.01 0.03, L 1, population covariance, valid windows, mean of R, "
    "G, B. PSNR: mean "
    "of the pictures' dB. Mask IoU: predicted mask at 0.5. FD: Frechet distance of the features named in fd.features, of full "
    "crops; not FID.";

struct Rendered {
  at::Tensor images, masks;  // (N, 3, H, W) 8-bit levels, (N, H, W)
};

RunConfig LoadConfig(const std::string& folder, const EvaluateOptions& options) {
  if (!fs::is_directory(folder)) throw IoError(folder, "no such folder; give the --out folder of `mvstudio avatar train`");
  const std::string config_path = folder + "/" + kRunConfigFile, checkpoint = folder + "/" + kCheckpointFile;
  if (!fs::exists(config_path)) throw IoError(config_path, "is missing: not the folder of a training run");
  if (!fs::exists(checkpoint))
    throw IoError(checkpoint,
                  "is missing: the run has not reached its first checkpoint; train it or `mvstudio avatar resume` it");
  RunConfig config = ReadRunConfig(config_path);
  if (!options.dataset.empty()) config.dataset = options.dataset;
  if (!fs::is_directory(config.dataset)) {
    throw IoError(config.dataset,
                  "the dataset that " + config_path + " was trained on is not there; pass its new place with --dataset");
  }
  return config;
}

// Which pictures are scored as held out.
struct Selection {
  std::string kind;
  std::vector<std::string> cameras;
  std::vector<int> frames;
};

Selection Holdout(const DatasetSplit& split, const std::string& folder) {
  if (split.holdout_cameras.empty() && split.holdout_frames.empty()) {
    throw UsageError(
        folder +
        ": nothing was held out in training, so nothing can be scored; train with --holdout-cameras and --holdout-frames");
  }
  if (split.holdout_frames.empty()) return {"held-out cameras in training frames", split.holdout_cameras, split.train_frames};
  if (split.holdout_cameras.empty()) return {"training cameras in held-out frames", split.train_cameras, split.holdout_frames};
  return {"held-out cameras in held-out frames", split.holdout_cameras, split.holdout_frames};
}

void RequireFrames(const dataset::PanopticDataset& data, const RunConfig& config) {
  for (const auto* frames : {&config.split.train_frames, &config.split.holdout_frames}) {
    for (const int frame : *frames) {
      const auto found = data.poses.find(frame);
      if (found != data.poses.end() && found->second.count(config.pack.person)) continue;
      throw UsageError("frame " + std::to_string(frame) + " of the run's split has no pose of person " +
                       std::to_string(config.pack.person) + " in " + data.root +
                       ": the dataset is not the one that was trained on");
    }
  }
}

PackResult Build(const dataset::PanopticDataset& data, const RunConfig& config, const Selection& selection,
                 const RunContext& run) {
  PackOptions options = config.pack;
  options.template_maps = false;
  options.cameras = selection.cameras;
  options.frames = selection.frames;
  return BuildPack(data, options, run);
}

Rendered RenderAll(AvatarModel& model, const AvatarPack& pack, int batch, const RunContext& run) {
  ProgressStage stage(run, "rendering", pack.size());
  const RenderedPack rendered = RenderPack(model, pack, std::max(1, batch), [&](int64_t count) { stage.Advance(count); });
  return {EightBit(rendered.images), rendered.masks.to(at::kDouble)};
}

std::vector<int64_t> Frames(const AvatarPack& pack) {
  return {pack.frame.data_ptr<int64_t>(), pack.frame.data_ptr<int64_t>() + pack.size()};
}

/// Temporal flicker over the frames that follow one another in the pack.
double FlickerOf(const AvatarPack& pack, const at::Tensor& truth, const at::Tensor& images) {
  const std::vector<int64_t> previous = PreviousRows(pack);
  double sum = 0;
  int64_t count = 0;
  for (int64_t i = 0; i < pack.size(); ++i) {
    const int64_t before = previous[i];
    if (before < 0) continue;
    const metrics::Score score = metrics::Flicker(ToPicture(truth[before]), ToPicture(truth[i]), ToPicture(images[before]),
                                                  ToPicture(images[i]), ToMask(pack.masks[before]), ToMask(pack.masks[i]));
    if (score.status == metrics::Status::kOk) sum += score.value, ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : std::nan("");
}

/// What every set of pictures is scored with.
struct Scorer {
  std::shared_ptr<const FeatureNet> net;
  uint64_t seed = 1;

  Scored operator()(const std::vector<PictureScore>& scores, const at::Tensor& truth, const at::Tensor& images) const {
    return {metrics::Mean(scores), CompareSets(truth, images, *net, seed)};
  }
};

std::vector<CameraScore> PerCamera(const AvatarPack& pack, const std::vector<PictureScore>& scores,
                                   const Baselines& baselines) {
  std::vector<CameraScore> cameras;
  for (size_t c = 0; c < pack.cameras.size(); ++c) {
    std::vector<PictureScore> own;
    for (int64_t i = 0; i < pack.size(); ++i) {
      if (pack.camera_idx[i].item<int64_t>() == static_cast<int64_t>(c)) own.push_back(scores[i]);
    }
    if (!own.empty()) cameras.push_back({pack.cameras[c], baselines.nearest_camera.at(pack.cameras[c]), metrics::Mean(own)});
  }
  return cameras;
}

// `count` pictures of each camera, evenly over its frames.
std::vector<int64_t> Examples(const AvatarPack& pack, int count) {
  std::vector<int64_t> chosen;
  for (size_t c = 0; c < pack.cameras.size(); ++c) {
    std::vector<int64_t> own;
    for (int64_t i = 0; i < pack.size(); ++i) {
      if (pack.camera_idx[i].item<int64_t>() == static_cast<int64_t>(c)) own.push_back(i);
    }
    const size_t number = std::min(own.size(), static_cast<size_t>(std::max(0, count)));
    for (size_t k = 0; k < number; ++k) chosen.push_back(own[(2 * k + 1) * own.size() / (2 * number)]);
  }
  return chosen;
}

std::vector<PictureStrip> WriteStrips(const std::string& folder, const EvaluateOptions& options, const AvatarPack& pack,
                                      const at::Tensor& truth, const Rendered& rendered, const Baselines& baselines,
                                      const std::vector<PictureScore>& scores) {
  std::vector<PictureStrip> strips;
  AtomicFolder out(folder, true);
  for (const int64_t i : Examples(pack, options.pictures)) {
    PictureStrip strip;
    strip.camera = pack.cameras[pack.camera_idx[i].item<int64_t>()];
    strip.frame = static_cast<int>(pack.frame[i].item<int64_t>());
    strip.ssim = scores[i].bbox.ssim, strip.psnr_db = scores[i].bbox.psnr_db;
    char name[32];
    std::snprintf(name, sizeof name, "_%08d.png", strip.frame);
    dataset::WriteImage(MakeStrip(truth[i], rendered.images[i], baselines.nearest_pose.images[i]),
                        out.work_path() + "/" + strip.camera + name);
    strip.path = folder + "/" + strip.camera + name;
    strips.push_back(strip);
  }
  out.Commit();
  return strips;
}

// The frames of a selection, thinned evenly so that at most `limit` pictures remain.
Selection Thinned(Selection selection, int limit) {
  const size_t count = std::max<size_t>(1, static_cast<size_t>(limit) / selection.cameras.size());
  if (selection.frames.size() <= count) return selection;
  std::vector<int> frames;
  for (size_t k = 0; k < count; ++k) frames.push_back(selection.frames[(2 * k + 1) * selection.frames.size() / (2 * count)]);
  selection.frames = frames;
  return selection;
}

void ScoreOtherSplits(const dataset::PanopticDataset& data, const EvaluateOptions& options, AvatarModel& model,
                      const Scorer& score, Evaluation* result, const RunContext& run) {
  const DatasetSplit& split = result->config.split;
  const std::vector<Selection> others = {{"training cameras in training frames", split.train_cameras, split.train_frames},
                                         {"held-out cameras in training frames", split.holdout_cameras, split.train_frames},
                                         {"training cameras in held-out frames", split.train_cameras, split.holdout_frames}};
  for (const Selection& selection : others) {
    if (options.other_pictures <= 0 || selection.cameras.empty() || selection.frames.empty() ||
        selection.kind == result->holdout_kind)
      continue;
    const AvatarPack pack = Build(data, result->config, Thinned(selection, options.other_pictures), run).pack;
    const Rendered rendered = RenderAll(model, pack, options.batch, run);
    const at::Tensor truth = EightBit(OnBlack(pack));
    result->other_splits[selection.kind] =
        score(ScorePictures(truth, pack.masks, rendered.images, rendered.masks), truth, rendered.images);
  }
}

}  // namespace

Evaluation Evaluate(const std::string& run_folder, const EvaluateOptions& options, const RunContext& run,
                    const std::function<double()>& clock_s) {
  at::set_num_threads(ResolveThreads(run.num_threads));
  Evaluation result;
  result.config = LoadConfig(run_folder, options);
  result.convention = kConvention;
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(result.config.dataset);
  RequireFrames(data, result.config);
  const Selection selection = Holdout(result.config.split, run_folder);
  result.holdout_kind = selection.kind;
  AvatarModel model = LoadModel(run_folder + "/" + kCheckpointFile);
  result.checkpoint_step = model.step;

  const PackResult built = Build(data, result.config, selection, run);
  const AvatarPack& pack = built.pack;
  result.skipped = built.skipped;
  const double start_s = clock_s ? clock_s() : std::nan("");
  const Rendered rendered = RenderAll(model, pack, options.batch, run);
  result.seconds_per_picture = ((clock_s ? clock_s() : std::nan("")) - start_s) / static_cast<double>(pack.size());

  const std::shared_ptr<const FeatureNet> net = options.features == "gabor" ? nullptr : FeatureNetByName(options.features);
  const at::Tensor truth = EightBit(OnBlack(pack));
  const std::vector<PictureScore> scores = ScorePictures(truth, pack.masks, rendered.images, rendered.masks);
  const Scorer score{net ? net : GaborNet(), run.seed};
  result.holdout = score(scores, truth, rendered.images);
  result.flicker = FlickerOf(pack, truth, rendered.images);
  std::vector<double> ssim, psnr;
  for (const PictureScore& one : scores) {
    ssim.push_back(one.bbox.ssim);
    psnr.push_back(std::min(one.bbox.psnr_db, 100.0));
  }
  result.ssim_interval = metrics::BlockBootstrap(ssim, Frames(pack), run.seed);
  result.psnr_interval = metrics::BlockBootstrap(psnr, Frames(pack), run.seed);

  const Baselines baselines = MakeBaselines(data, result.config.split, result.config.pack, pack, run);
  const auto score_baseline = [&](const BaselinePictures& pictures) {
    const at::Tensor images = EightBit(pictures.images);
    return score(ScorePictures(truth, pack.masks, images, pictures.masks), truth, images);
  };
  result.mean_image = score_baseline(baselines.mean_image);
  result.nearest_pose = score_baseline(baselines.nearest_pose);
  result.per_camera = PerCamera(pack, scores, baselines);
  result.strips = WriteStrips(run_folder + "/eval", options, pack, truth, rendered, baselines, scores);
  ScoreOtherSplits(data, options, model, score, &result, run);
  return result;
}

}  // namespace mvstudio::avatar
