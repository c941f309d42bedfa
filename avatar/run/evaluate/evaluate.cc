#include "avatar/run/evaluate/evaluate.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>

#include "avatar/maps/template_maps.h"
#include "avatar/nets/model.h"
#include "avatar/nets/sequence.h"
#include "avatar/run/evaluate/baselines.h"
#include "avatar/run/evaluate/evaluate_groups.h"
#include "avatar/run/evaluate/posenet_features.h"
#include "avatar/run/evaluate/strips.h"
#include "avatar/run/evaluate/subject.h"
#include "avatar/run/pack/frame_runs.h"
#include "avatar/run/pack/pack_rows.h"
#include "avatar/run/pack/split_side.h"
#include "avatar/scores/image_scores.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/studio_names.h"
#include "dataset/session/session.h"

namespace mvstudio::avatar {
namespace {

using metrics::ImageScore;

namespace fs = std::filesystem;

constexpr char kConvention[] =
    "Truth: the dataset's image on black behind its mask. Render: on black behind its own predicted mask. Crops as in "
    "training, 8-bit sRGB, "
    "RGB in [0, 1]. Primary region: bounding box of the true mask grown by 5 %; also given: full (the whole crop) and masked "
    "(pixels of the true mask). SSIM: Wang 2004, Gaussian 11x11 sigma 1.5, K 0.01 0.03, L 1, population covariance, valid "
    "windows, mean of R, "
    "G, B. PSNR: mean "
    "of the images' dB. Mask IoU: predicted mask at 0.5. FD: Frechet distance of the features named in fd.features, of full "
    "crops; it is called FID only with the Inception weights of 2015. LPIPS, where given: of full crops.";

/// What stays the same for all splits of one evaluation.
struct Session {
  const dataset::PanopticDataset& data;
  const EvaluateOptions& options;
  const RunContext& run;
  std::shared_ptr<const FeatureNet> net;
  std::shared_ptr<const ImageDistance> lpips;  // may be null
};

SplitSide Holdout(const DatasetSplit& split, const std::string& folder) {
  SplitSide side = HoldoutSide(split);
  if (side.cameras.empty()) {
    throw UsageError(folder +
                     ": nothing was held out in training, so nothing can be scored; train with option 'holdout-cameras' and "
                     "option 'holdout-frames'");
  }
  return side;
}

/// The frames of the split, and the training cameras, whose images the baselines are made of.
void RequireSplit(const dataset::PanopticDataset& data, const RunConfig& config) {
  for (const std::string& camera : config.split.train_cameras) {
    if (data.rig.Find(camera) < 0) {
      throw UsageError(data.root + " has no camera " + camera +
                       ", which the run was trained on: the baselines need its images; give a dataset that has them");
    }
  }
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

/// `all`: the frames that those of the selection were chosen from, for what is consecutive.
TrainingSet Build(const Session& session, const RunConfig& config, int size_px, const SplitSide& selection,
                  const std::vector<int>& all) {
  TrainingSetOptions options = config.pack;
  options.frame_step = std::max(1, UsualStep(all));
  options.template_maps = false;
  options.size_px = size_px;
  options.cameras = selection.cameras;
  options.frames = selection.frames;
  if (ShowsItsPoses(config.split, selection)) options.pose_by = PoseBy::kJoints;
  return BuildTrainingSet(session.data, options, session.run);
}

/// Temporal flicker of each row against the frame before it in the pack; NaN where there is none.
std::vector<double> FlickerOf(const AvatarPack& pack, const at::Tensor& truth, const at::Tensor& images) {
  const std::vector<int64_t> previous = PreviousRows(pack);
  std::vector<double> values(pack.size(), std::nan(""));
  for (int64_t i = 0; i < pack.size(); ++i) {
    const int64_t before = previous[i];
    if (before < 0) continue;
    const metrics::Score score =
        metrics::Flicker(ToPlanarImage(truth[before]), ToPlanarImage(truth[i]), ToPlanarImage(images[before]),
                         ToPlanarImage(images[i]), ToMask(pack.masks[before]), ToMask(pack.masks[i]));
    if (score.status == metrics::Status::kOk) values[i] = score.value;
  }
  return values;
}

std::vector<double> LpipsOf(const Session& session, const at::Tensor& truth, const at::Tensor& images) {
  std::vector<double> values;
  if (!session.lpips) return values;
  constexpr int64_t kAtATime = 8;
  for (int64_t i = 0; i < truth.size(0); i += kAtATime) {
    const int64_t end = std::min(truth.size(0), i + kAtATime);
    const at::Tensor some = (*session.lpips)(truth.slice(0, i, end), images.slice(0, i, end));
    values.insert(values.end(), some.data_ptr<double>(), some.data_ptr<double>() + some.numel());
  }
  return values;
}

Scored Summary(const Session& session, const RowScores& rows, const at::Tensor& truth, const at::Tensor& images) {
  return {metrics::Mean(rows.images), CompareSets(truth, images, *session.net, session.run.seed), FiniteMean(rows.lpips)};
}

RowScores ScoreRows(const Session& session, const AvatarPack& pack, const at::Tensor& truth, const RenderedRows& rendered) {
  return {ScoreImages(truth, pack.masks, rendered.images, rendered.masks), LpipsOf(session, truth, rendered.images), {}};
}

std::string CameraAndFrame(const dataset::PanopticDataset& data, const AvatarPack& pack, int64_t row) {
  return dataset::Slug(dataset::StudioName(data, pack.cameras[pack.camera_idx[row].item<int64_t>()])) +
         Format("_%08lld", static_cast<long long>(pack.frame[row].item<int64_t>()));
}

// eval/truth and eval/render, the same names in both.
void WriteRenders(const dataset::PanopticDataset& data, const std::string& work, int count, const AvatarPack& pack,
                  const at::Tensor& truth, const RenderedRows& rendered) {
  if (count == 0) return;
  const auto cameras = static_cast<int>(pack.cameras.size());
  for (const int64_t i : Examples(pack, count < 0 ? -1 : (count + cameras - 1) / cameras)) {
    const std::string name = CameraAndFrame(data, pack, i) + ".png";
    MakeFolder(work + "/truth"), MakeFolder(work + "/render");
    dataset::WriteImage(ImageOfBytes((truth[i] * 255).round().to(at::kByte)), work + "/truth/" + name);
    dataset::WriteImage(ImageOfBytes((rendered.images[i] * 255).round().to(at::kByte)), work + "/render/" + name);
  }
}

std::vector<ImageStrip> WriteImages(const dataset::PanopticDataset& data, const std::string& folder,
                                    const EvaluateOptions& options, const AvatarPack& pack, const at::Tensor& truth,
                                    const RenderedRows& rendered, const Baselines& baselines, const RowScores& scores) {
  std::vector<ImageStrip> strips;
  AtomicFolder out(folder, true);
  for (const int64_t i : Examples(pack, std::max(0, options.images))) {
    ImageStrip strip;
    strip.camera = pack.cameras[pack.camera_idx[i].item<int64_t>()];
    strip.frame = static_cast<int>(pack.frame[i].item<int64_t>());
    strip.ssim = scores.images[i].bbox.ssim, strip.psnr_db = scores.images[i].bbox.psnr_db;
    const std::string name = "/" + CameraAndFrame(data, pack, i) + ".png";
    dataset::WriteImage(MakeStrip(truth[i], rendered.images[i], baselines.nearest_pose.images[i]), out.work_path() + name);
    strip.path = folder + name;
    strips.push_back(strip);
  }
  WriteRenders(data, out.work_path(), options.renders, pack, truth, rendered);
  out.Commit();
  return strips;
}

// The frames of a selection that have images, thinned evenly so that at most `limit` images remain.
SplitSide Thinned(const dataset::PanopticDataset& data, SplitSide selection, int limit) {
  const size_t count = std::max<size_t>(1, static_cast<size_t>(limit) / selection.cameras.size());
  selection.frames = FramesWithImages(data, selection);
  if (selection.frames.size() <= count) return selection;
  std::vector<int> frames;
  for (size_t k = 0; k < count; ++k) frames.push_back(selection.frames[(2 * k + 1) * selection.frames.size() / (2 * count)]);
  selection.frames = frames;
  return selection;
}

/// The frames of `some` and those that a method with memory has seen before each of them in `all`.
SplitSide WithPast(SplitSide some, std::vector<int> all) {
  std::sort(all.begin(), all.end());
  std::set<int> frames;
  for (const int frame : some.frames) {
    const auto at = std::lower_bound(all.begin(), all.end(), frame);
    frames.insert(at - std::min<int64_t>(at - all.begin(), kNumPrevious), at + 1);
  }
  some.frames.assign(frames.begin(), frames.end());
  return some;
}

/// Rendered images of `some`, whose frames are a part of `all`.
RenderedRows RenderSome(Subject& subject, const TrainingSet& some, const SplitSide& thinned, const std::vector<int>& all,
                        const RunConfig& config, const Session& session) {
  const AvatarPack& pack = some.pack;
  if (!subject.HasMemory()) return RenderRows(subject, config, some, session.options.batch, session.run);
  const TrainingSet longer = Build(session, config, pack.size_px, WithPast(thinned, all), all);
  std::map<std::pair<int64_t, int64_t>, int64_t> row_of;
  const auto view = [](const AvatarPack& p, int64_t i) {
    return std::pair(p.camera_idx[i].item<int64_t>(), p.frame[i].item<int64_t>());
  };
  for (int64_t i = 0; i < longer.pack.size(); ++i) row_of[view(longer.pack, i)] = i;
  std::vector<int64_t> rows;
  for (int64_t i = 0; i < pack.size(); ++i) rows.push_back(row_of.at(view(pack, i)));
  const RenderedRows rendered = RenderRows(subject, config, longer, session.options.batch, session.run);
  const at::Tensor index = at::tensor(rows, at::kLong);
  return {rendered.images.index_select(0, index), rendered.masks.index_select(0, index)};
}

ProtocolSplit ImagesOf(const std::string& kind, const AvatarPack& pack) {
  ProtocolSplit split{kind, {}};
  for (int64_t i = 0; i < pack.size(); ++i) {
    split.images.emplace_back(pack.cameras[pack.camera_idx[i].item<int64_t>()],
                              static_cast<int>(pack.frame[i].item<int64_t>()));
  }
  return split;
}

std::vector<ProtocolSplit> ScoreOtherSplits(const Session& session, Subject& subject, Evaluation* result) {
  const DatasetSplit& split = result->config.split;
  const std::vector<SplitSide> others = {TrainingSide(split),
                                         {"held-out cameras in training frames", split.holdout_cameras, split.train_frames},
                                         {"training cameras in held-out frames", split.train_cameras, split.holdout_frames}};
  std::vector<ProtocolSplit> scored;
  for (const SplitSide& selection : others) {
    if (session.options.other_images <= 0 || selection.cameras.empty() || selection.frames.empty() ||
        selection.kind == result->holdout_kind)
      continue;
    const SplitSide thinned = Thinned(session.data, selection, session.options.other_images);
    if (thinned.frames.empty()) continue;  // the dataset has no image of this split
    const TrainingSet built = Build(session, result->config, result->size_px, thinned, selection.frames);
    const AvatarPack& pack = built.pack;
    const RenderedRows rendered = RenderSome(subject, built, thinned, selection.frames, result->config, session);
    const at::Tensor truth = EightBit(OnBlack(pack));
    result->other_splits[selection.kind] = Summary(session, ScoreRows(session, pack, truth, rendered), truth, rendered.images);
    scored.push_back(ImagesOf(selection.kind, pack));
  }
  return scored;
}

void ScoreBaselines(const Session& session, const AvatarPack& pack, const at::Tensor& truth, const Baselines& baselines,
                    Evaluation* result) {
  const auto score = [&](const BaselineImages& images) {
    const RenderedRows shown{EightBit(images.images), images.masks};
    return Summary(session, ScoreRows(session, pack, truth, shown), truth, shown.images);
  };
  result->mean_image = score(baselines.mean_image);
  result->nearest_pose = score(baselines.nearest_pose);
  result->nearest_camera = baselines.nearest_camera;
}

/// The avatar's textures on the posed template that its network corrects.
void ScoreTemplateAlone(const Session& session, const Subject& subject, const TrainingSet& built, const at::Tensor& truth,
                        Evaluation* result) {
  if (!subject.network) return;
  const AvatarModel& model = *subject.network;
  if (NumTemplateChannels(model.options) == 0 || model.options.method != Method::kTna) return;
  Subject alone;
  alone.network = MakeModel(model.options, model.size_px, model.depth, 0);  // a fresh network corrects nothing
  alone.network->textures = model.textures;
  const RenderedRows rendered = RenderRows(alone, result->config, built, session.options.batch, session.run);
  result->template_alone = Summary(session, ScoreRows(session, built.pack, truth, rendered), truth, rendered.images);
}

Scored ScoreBody(const Session& session, const AvatarPack& pack, const at::Tensor& truth) {
  const at::Tensor body = pack.body_images.to(at::kDouble) / 255;
  const RenderedRows rendered{body.slice(1, 0, 3), body.select(1, 3)};
  return Summary(session, ScoreRows(session, pack, truth, rendered), truth, rendered.images);
}

/// The fitted body without a network.
void ScoreBodyAlone(const Session& session, const SplitSide& selection, const AvatarPack& pack, const at::Tensor& truth,
                    Evaluation* result) {
  if (!pack.body_images.defined()) return;
  result->body_alone = ScoreBody(session, pack, truth);
  if (result->config.pack.pose_by == PoseBy::kJoints || ShowsItsPoses(result->config.split, selection)) return;
  RunConfig by_joints = result->config;
  by_joints.pack.pose_by = PoseBy::kJoints, by_joints.pack.template_input_px = 0;
  by_joints.pack.keep_views = false;
  const AvatarPack posed = Build(session, by_joints, pack.size_px, selection, selection.frames).pack;
  if (posed.size() == pack.size()) result->body_by_joints = ScoreBody(session, posed, truth);
}

Session MakeSession(const dataset::PanopticDataset& data, const EvaluateOptions& options, const RunContext& run) {
  const std::shared_ptr<const FeatureNet> net = options.features == "gabor" ? nullptr : FeatureNetByName(options.features);
  return {data, options, run, net ? net : GaborNet(), options.lpips.empty() ? nullptr : LoadImageDistance(options.lpips)};
}

void DescribeNets(const Session& session, Evaluation* result) {
  result->features = {session.net->name(), session.net->sha256()};
  if (session.lpips) result->lpips = {session.lpips->name(), session.lpips->sha256()};
  result->distance_name = DistanceName(result->features.name, result->features.sha256);
}

}  // namespace

Evaluation Evaluate(const std::string& run_folder, const EvaluateOptions& options, const RunContext& run,
                    const std::function<double()>& clock_s) {
  at::set_num_threads(ResolveThreads(run.num_threads));
  Evaluation result;
  result.config = OpenRun(run_folder, options.dataset);
  result.size_px = options.score_size > 0 ? options.score_size : result.config.pack.size_px;
  result.convention = kConvention;
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(result.config.dataset);
  UseCameras(data, options.cameras, &result.config.split);
  RequireSplit(data, result.config);
  const SplitSide selection = Holdout(result.config.split, run_folder);
  result.missing = RequireImages(data, selection);
  result.frames_without_person = FramesWithout(data, result.config.pack.person);
  const std::vector<MotionFrames> motions =
      ParseMotions(options.motions, options.motions.empty() ? selection.frames : FramesWithImages(data, selection),
                   CutsOf(data, result.config.pack.person));
  result.holdout_kind = selection.kind;
  const Session session = MakeSession(data, options, run);
  DescribeNets(session, &result);
  Subject subject = ReadSubject(run_folder, result.config);
  result.training = subject.training, result.checkpoint_step = subject.step, result.num_parameters = subject.num_parameters;
  result.config.pack.template_colours = subject.network && CorrectsColours(subject.network->options);

  const TrainingSet built = Build(session, result.config, result.size_px, selection, selection.frames);
  const AvatarPack& pack = built.pack;
  result.skipped = built.skipped;
  const double start_s = clock_s ? clock_s() : std::nan("");
  const RenderedRows rendered = RenderRows(subject, result.config, built, options.batch, run);
  result.seconds_per_image = ((clock_s ? clock_s() : std::nan("")) - start_s) / static_cast<double>(pack.size());

  const at::Tensor truth = EightBit(OnBlack(pack));
  RowScores rows = ScoreRows(session, pack, truth, rendered);
  rows.flicker = FlickerOf(pack, truth, rendered.images);
  result.holdout = Summary(session, rows, truth, rendered.images);
  result.flicker = FiniteMean(rows.flicker);
  result.intervals = Intervals(pack, rows, run.seed);
  result.per_camera = PerCamera(pack, rows, run.seed);
  result.per_motion = PerMotion(pack, rows, motions, run.seed);
  TrainingSetOptions crop = result.config.pack;
  crop.size_px = result.size_px;
  const Baselines baselines = MakeBaselines(data, result.config.split, crop, pack, run);
  ScoreBaselines(session, pack, truth, baselines, &result);
  ScoreBodyAlone(session, selection, pack, truth, &result);
  ScoreTemplateAlone(session, subject, built, truth, &result);
  result.strips = WriteImages(data, run_folder + "/eval", options, pack, truth, rendered, baselines, rows);
  const std::vector<ProtocolSplit> others = ScoreOtherSplits(session, subject, &result);
  result.protocol = MakeProtocol(
      {&data, result.config, result.size_px, ImagesOf(selection.kind, pack), others, result.features, result.lpips});
  WriteFileAtomic(run_folder + "/" + kProtocolFile, result.protocol.json_text);
  return result;
}

}  // namespace mvstudio::avatar
