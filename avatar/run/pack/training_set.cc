#include "avatar/run/pack/training_set.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <set>

#include "avatar/body/mesh_raster.h"
#include "avatar/maps/template_maps.h"
#include "avatar/run/pack/frame_runs.h"
#include "avatar/run/pack/iuv.h"
#include "avatar/run/pack/pack_rows.h"
#include "avatar/run/pack/shape_fit.h"
#include "avatar/run/pack/template_view.h"
#include "core/check.h"
#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "core/join.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/studio_names.h"
#include "dataset/views/crop.h"
#include "dataset/views/person_extents.h"

namespace mvstudio::avatar {
namespace {

constexpr int kFitSizePx = 96;
constexpr int64_t kMinPersonPx = 16;  // a crop with less of the person is of no use

std::string Name(const std::string& camera, int frame) { return "camera " + camera + ", frame " + std::to_string(frame); }

std::string ResolveCamera(const dataset::PanopticDataset& data, const std::string& name) {
  const std::string resolved = data.Resolve(name);
  if (!resolved.empty() && data.rig.Find(resolved) >= 0) return resolved;
  std::vector<std::string> known = geometry::CameraNames(data.rig);
  for (std::string& camera : known) camera = dataset::StudioName(data, camera);
  throw UsageError("camera '" + name + "' is not in the dataset " + data.root + "; it has " + Join(known, ", "));
}

/// Those of `asked` that the person is in, or with `of_anyone` anybody.
std::vector<int> FramesWithPose(const dataset::PanopticDataset& data, int person, const std::vector<int>& asked,
                                std::vector<int> known, bool of_anyone) {
  for (const auto& [frame, people] : data.poses) {
    if (of_anyone) known.push_back(frame);
  }
  const std::string who = of_anyone ? "" : "person " + std::to_string(person) + " in ";
  return KnownFrames(of_anyone ? "option 'holdout-frames'" : "frames", asked, std::move(known), who + data.root).frames;
}

struct Job {
  int camera_idx;  // in the pack's list
  const geometry::RigCamera* camera;
  int frame;
  const dataset::Coco19Pose* pose;
  dataset::PersonExtent extent;
};

// The options with every choice made.
struct Plan {
  int person = -1;
  double half_extent_m = 0;
  std::vector<std::string> cameras;
  std::vector<int> frames;
  std::vector<Job> jobs;
  std::vector<std::string> skipped;
  dataset::MissingImages missing;
};

double LargeExtent(const dataset::PanopticDataset& data, int person) {
  const std::map<int, double> extents = dataset::LargeExtents(data);
  const auto found = extents.find(person);
  if (found == extents.end())
    throw FormatError(data.root, "", "no camera has person " + std::to_string(person) + " in front of it");
  return found->second;
}

Plan MakePlan(const dataset::PanopticDataset& data, const TrainingSetOptions& options) {
  Plan plan;
  plan.person = ChoosePerson(data, options.person);
  plan.half_extent_m = options.half_extent_m > 0 ? options.half_extent_m : LargeExtent(data, plan.person);
  const std::vector<int> known = FramesOfPerson(data, plan.person);
  for (const std::string& name : options.cameras) plan.cameras.push_back(ResolveCamera(data, name));
  if (options.cameras.empty()) plan.cameras = geometry::CameraNames(data.rig);
  plan.frames = options.frames.empty() ? known : FramesWithPose(data, plan.person, options.frames, known, false);
  plan.missing = dataset::FindMissing(data, plan.cameras, plan.frames);
  for (size_t c = 0; c < plan.cameras.size(); ++c) {
    const geometry::RigCamera& camera = data.rig.cameras[data.rig.Find(plan.cameras[c])];
    for (const int frame : plan.frames) {
      if (plan.missing.Has(plan.cameras[c], frame)) continue;
      const dataset::Coco19Pose& pose = data.poses.at(frame).at(plan.person);
      const auto extent = dataset::MeasurePerson(pose, camera);
      if (extent) {
        plan.jobs.push_back({static_cast<int>(c), &camera, frame, &pose, *extent});
      } else {
        plan.skipped.push_back(Name(plan.cameras[c], frame) + ": the person is not in front of the camera");
      }
    }
  }
  return plan;
}

Image ReadFor(const dataset::PanopticDataset& data, const Job& job, bool mask) {
  const std::string &camera = job.camera->camera.name, name = Name(camera, job.frame), what = mask ? "mask" : "picture";
  const std::string path = mask ? data.MaskPath(camera, job.frame) : data.ImagePath(camera, job.frame);
  if (!std::filesystem::exists(path)) throw IoError(path, "the " + what + " of " + name + " was removed meanwhile");
  Image image = mask ? data.ReadMask(camera, job.frame) : dataset::ReadImage(path);
  if (image.width != job.camera->camera.width_px || image.height != job.camera->camera.height_px) {
    throw FormatError(path, "",
                      what + " of " + name + " is " + std::to_string(image.width) + "x" + std::to_string(image.height) +
                          ", the calibration says " + std::to_string(job.camera->camera.width_px) + "x" +
                          std::to_string(job.camera->camera.height_px));
  }
  return image;
}

// Binary mask of the person as the crop's camera sees it.
Image CropMask(const dataset::PanopticDataset& data, const Job& job, const geometry::RigCamera& crop) {
  Image mask = dataset::Resample(ReadFor(data, job, true), *job.camera, crop);
  for (uint8_t& value : mask.pixels) value = value >= 128 ? 255 : 0;
  return mask;
}

std::map<int, body::BodyPose> PoseFrames(const body::BodyTemplate& body, const std::vector<Job>& jobs) {
  std::map<int, body::BodyPose> poses;
  for (const Job& job : jobs) {
    if (poses.count(job.frame)) continue;
    body::BodyPose pose;
    if (body::PoseFromJoints(body, job.pose->x_in_world, dataset::PlausibleJoints(*job.pose), &pose)) poses[job.frame] = pose;
  }
  return poses;
}

BodyShape FitGirth(const dataset::PanopticDataset& data, const TrainingSetOptions& options, const Plan& plan,
                   const RunContext& run) {
  const body::BodyTemplate body = body::MakeMannequin(1.75, 0.6);
  const std::map<int, body::BodyPose> poses = PoseFrames(body, plan.jobs);
  std::vector<const Job*> usable;
  for (const Job& job : plan.jobs) {
    if (poses.count(job.frame)) usable.push_back(&job);
  }
  if (usable.empty()) return options.shape;
  const size_t count = std::min<size_t>(usable.size(), std::max(1, options.fit_images));
  std::vector<ShapeView> views(count);
  ParallelFor(static_cast<int64_t>(count), run.num_threads, [&](int64_t i) {
    const Job& job = *usable[(2 * i + 1) * usable.size() / (2 * count)];
    const auto crop = dataset::CropCamera(*job.camera, job.extent.middle_in_cam, plan.half_extent_m, options.fill, kFitSizePx);
    views[i] = {poses.at(job.frame), crop, CropMask(data, job, crop)};
  });
  return FitShape(body, options.shape, views, run).shape;
}

JointSource SourceOf(const dataset::PanopticDataset& data, const TrainingSetOptions& options, const Plan& plan) {
  std::vector<int> frames;
  for (const Job& job : plan.jobs) frames.push_back(job.frame);
  return {data, plan.person, options.num_joints, options.pose3d, frames};
}

// Everything that the images share while they are filled in, in parallel.
struct Filler {
  const dataset::PanopticDataset& data;
  const TrainingSetOptions& options;
  const Plan& plan;
  const body::BodyTemplate* body;  // nullptr: no template is posed
  JointSource joints;
  std::map<int, Eigen::Matrix3Xf> vertices;  // by frame, world: posed as the options say
  std::map<int, Eigen::Matrix3Xf> seen;      // by frame, world: posed by images

  geometry::RigCamera CropOf(const Job& job) const {
    return dataset::CropCamera(*job.camera, job.extent.middle_in_cam, plan.half_extent_m, options.fill, options.size_px);
  }

  // As Fill below.
  std::string FillIuv(AvatarPack& pack, int64_t i, const Job& job, const geometry::RigCamera& crop) const {
    const std::string& camera = job.camera->camera.name;
    const std::string path = IuvPath(options.iuv, camera, data.ImagePath(camera, job.frame));
    if (!std::filesystem::exists(path)) return path + " is missing: no IUV map";
    FillLabels(pack, i, ReadIuv(path, *job.camera, crop));
    return "";
  }

  // Reason why the image cannot be used, or empty.
  std::string Fill(AvatarPack& pack, int64_t i, const std::vector<Job>& jobs) const {
    const Job& job = jobs[i];
    const geometry::RigCamera crop = CropOf(job);
    const Image mask = CropMask(data, job, crop);
    if (std::count(mask.pixels.begin(), mask.pixels.end(), 255) < kMinPersonPx)
      return "the mask is empty where the person should be";
    const Image image = ReadFor(data, job, false);
    FillImage(pack, i, dataset::Resample(image, *job.camera, crop), mask);
    FillPose(pack, i, joints.At(job.frame, *job.pose), crop);
    pack.camera_idx.data_ptr<int64_t>()[i] = job.camera_idx;
    pack.frame.data_ptr<int64_t>()[i] = job.frame;
    const bool labelled = options.template_maps && !options.iuv.empty();
    const std::string problem = labelled ? FillIuv(pack, i, job, crop) : "";
    if (!problem.empty() || !body) return problem;
    const auto found = vertices.find(job.frame);
    if (found == vertices.end()) return "neck, shoulders and hips do not fix the trunk of the body template";
    const auto better = seen.find(job.frame);
    const Eigen::Matrix3Xf& labels = better == seen.end() ? found->second : better->second;
    if (options.template_maps && !labelled) FillLabels(pack, i, body::RasterizeBody(*body, labels, crop));
    if (pack.body_images.defined())
      FillBodyImage(pack, i, body::RenderBody(*body, options.fitted->textures, found->second, crop));
    FillNetworkInput(pack, i, found->second, crop);
    return "";
  }

  void FillNetworkInput(AvatarPack& pack, int64_t i, const Eigen::Matrix3Xf& posed, const geometry::RigCamera& crop) const {
    const int px = options.template_input_px;
    const int64_t area = int64_t{px} * px;
    if (pack.template_maps.defined())
      FillTemplateMaps(*body, posed, crop, px, pack.template_maps.data_ptr<float>() + i * kTemplateMaps * area);
    if (pack.template_colours.defined())
      FillTemplateColours(*body, options.fitted->textures, posed, crop, px,
                          pack.template_colours.data_ptr<uint8_t>() + i * 3 * area);
  }
};

/// The body that is posed in the images.
body::BodyTemplate BodyOf(const dataset::PanopticDataset& data, const TrainingSetOptions& options, const Plan& plan,
                          const RunContext& run, BodyShape* shape) {
  if (options.fitted) return options.fitted->person.body;
  if (options.fit_shape) *shape = FitGirth(data, options, plan, run);
  return ScaleGirth(body::MakeMannequin(), *shape);
}

void PoseBody(const Plan& plan, const RunContext& run, Filler* filler) {
  std::map<int, const dataset::Coco19Pose*> poses;
  for (const Job& job : plan.jobs) poses.emplace(job.frame, job.pose);
  const std::vector<std::pair<int, const dataset::Coco19Pose*>> list(poses.begin(), poses.end());
  std::vector<std::optional<Eigen::Matrix3Xf>> vertices(list.size());
  const body::TexturedPerson* fitted = filler->options.fitted.get();
  ParallelFor(static_cast<int64_t>(list.size()), run.num_threads, [&](int64_t i) {
    vertices[i] = fitted ? PosedVertices(fitted->person, *list[i].second) : PosedVertices(*filler->body, *list[i].second);
  });
  for (size_t i = 0; i < list.size(); ++i) {
    if (vertices[i]) filler->vertices[list[i].first] = *vertices[i];
    if (!fitted || !fitted->person.seen.count(list[i].first)) continue;
    const body::BodyPose pose = ToBodyPose(fitted->person.body, fitted->person.seen.at(list[i].first));
    const auto seen = filler->seen.emplace(list[i].first, SkinVertices(fitted->person.body, pose)).first;
    if (filler->options.pose_by == PoseBy::kImages) filler->vertices[list[i].first] = seen->second;
  }
}

/// With keep_views: the crop and the body of each of the rows `good`.
std::vector<RowView> ViewsOf(const Filler& filler, const std::vector<int64_t>& good) {
  std::vector<RowView> views;
  std::map<int, std::shared_ptr<const Eigen::Matrix3Xf>> shared;
  for (const auto& [frame, vertices] : filler.vertices) shared[frame] = std::make_shared<const Eigen::Matrix3Xf>(vertices);
  for (const int64_t i : good) {
    const Job& job = filler.plan.jobs[i];
    views.push_back({filler.CropOf(job), shared.at(job.frame)});
  }
  return views;
}

double MeanTemplateIou(const AvatarPack& pack) {
  const at::Tensor a = pack.part > 0, b = pack.masks > 0;
  const at::Tensor both = a.logical_and(b).sum({1, 2}).to(at::kDouble), any = a.logical_or(b).sum({1, 2}).to(at::kDouble);
  return (both / any.clamp_min(1)).mean().item<double>();
}

}  // namespace

int ChoosePerson(const dataset::PanopticDataset& data, int requested) {
  std::map<int, int> frames;
  for (const auto& [frame, people] : data.poses) {
    for (const auto& [id, pose] : people) ++frames[id];
  }
  if (frames.empty()) throw FormatError(data.root, "", "no frame has a person in it");
  if (requested >= 0) {
    if (!frames.count(requested)) {
      const auto id = [](const auto& frame) { return std::to_string(frame.first); };
      throw UsageError("person " + std::to_string(requested) + " is not in the dataset " + data.root + "; it has " +
                       Join(frames, ", ", id));
    }
    return requested;
  }
  return std::max_element(frames.begin(), frames.end(), [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

DatasetSplit SplitDataset(const dataset::PanopticDataset& data, int person, const std::vector<std::string>& holdout_cameras,
                          const std::vector<int>& holdout_frames, const std::vector<std::string>& train_cameras) {
  person = ChoosePerson(data, person);
  const std::vector<int> known = FramesOfPerson(data, person);
  std::set<std::string> cameras;
  for (const std::string& name : holdout_cameras) cameras.insert(ResolveCamera(data, name));
  std::set<std::string> training;
  for (const std::string& name : train_cameras) {
    training.insert(ResolveCamera(data, name));
    if (cameras.count(ResolveCamera(data, name))) throw UsageError("camera " + name + " is to be trained on and held out");
  }
  const std::vector<int> held_out = FramesWithPose(data, person, holdout_frames, known, true);
  const std::set<int> frames(held_out.begin(), held_out.end());
  DatasetSplit split;
  for (const auto& camera : data.rig.cameras) {
    const std::string& name = camera.camera.name;
    if (cameras.count(name)) split.holdout_cameras.push_back(name);
    if (!cameras.count(name) && (training.empty() || training.count(name))) split.train_cameras.push_back(name);
  }
  for (const int frame : known) (frames.count(frame) ? split.holdout_frames : split.train_frames).push_back(frame);
  if (split.train_cameras.empty()) throw UsageError("every camera is held out: nothing is left to train on");
  if (split.train_frames.empty()) throw UsageError("every frame is held out: nothing is left to train on");
  if (!holdout_frames.empty() && split.holdout_frames.empty())
    throw UsageError("person " + std::to_string(person) + " is in none of the frames that are held out");
  return split;
}

TrainingSet BuildTrainingSet(const dataset::PanopticDataset& data, const TrainingSetOptions& options, const RunContext& run) {
  if (options.size_px < 16 || options.size_px > 4096)
    throw UsageError("size " + std::to_string(options.size_px) + " px: must be 16 to 4096");
  if (!(options.fill > 0.1 && options.fill <= 1))
    throw UsageError("fill " + std::to_string(options.fill) + ": must be 0.1 to 1");
  MVS_CHECK(options.fitted || !options.template_colours, "a body without a fit has no colours");
  MVS_CHECK(options.fitted || !options.keep_views, "views of a body without a fit");
  const Plan plan = MakePlan(data, options);
  TrainingSet result;
  result.missing = plan.missing;
  result.person = plan.person, result.half_extent_m = plan.half_extent_m, result.skipped = plan.skipped;
  const bool posed = (options.template_maps && options.iuv.empty()) || options.template_input_px > 0 || options.fitted;
  result.shape = options.shape;
  const body::BodyTemplate body = posed ? BodyOf(data, options, plan, run, &result.shape) : body::BodyTemplate{};
  Filler filler{data, options, plan, posed ? &body : nullptr, SourceOf(data, options, plan), {}, {}};
  if (posed) PoseBody(plan, run, &filler);
  AvatarPack pack = EmptyPack(plan.cameras, static_cast<int64_t>(plan.jobs.size()), options);
  SetTime(data, plan.person, plan.frames, options.frame_step, &pack);
  const auto count = static_cast<int64_t>(plan.jobs.size());
  std::vector<std::string> reasons(count);
  ProgressStage stage(run, "cropping images", count);
  constexpr int64_t kChunk = 64;
  for (int64_t begin = 0; begin < count; begin += kChunk) {
    const int64_t size = std::min(kChunk, count - begin);
    ParallelFor(size, run.num_threads, [&](int64_t i) { reasons[begin + i] = filler.Fill(pack, begin + i, plan.jobs); });
    stage.Advance(size);
  }
  std::vector<int64_t> good;
  for (int64_t i = 0; i < count; ++i) {
    if (reasons[i].empty())
      good.push_back(i);
    else
      result.skipped.push_back(Name(plan.cameras[plan.jobs[i].camera_idx], plan.jobs[i].frame) + ": " + reasons[i]);
  }
  if (good.empty()) {
    throw FormatError(data.root, "",
                      "no image can be used" + (result.skipped.empty() ? std::string() : "; " + result.skipped.front()) +
                          (plan.missing.missing() > 0 ? "; " + dataset::MissingText(plan.missing) : std::string()));
  }
  if (options.keep_views) result.views = ViewsOf(filler, good);
  result.pack = static_cast<int64_t>(good.size()) == count ? pack : Select(pack, good);
  result.template_iou = options.template_maps ? MeanTemplateIou(result.pack) : std::numeric_limits<double>::quiet_NaN();
  return result;
}

}  // namespace mvstudio::avatar
