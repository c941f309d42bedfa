#include <algorithm>
#include <cmath>
#include <filesystem>

#include "avatar/run/pack/body_shape.h"
#include "avatar/run/pack/template_view.h"
#include "avatar/run/render/bvh_pose.h"
#include "avatar/run/render/render.h"
#include "core/error.h"
#include "core/join.h"
#include "core/statistics.h"
#include "core/units.h"
#include "dataset/panoptic/studio_names.h"
#include "dataset/session/session.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

constexpr ChoiceWords<ScaleNormalise, 2> kScaleWords = {{{ScaleNormalise::kOn, "on"}, {ScaleNormalise::kOff, "off"}}};
constexpr ChoiceWords<RenderPlace, 3> kPlaceWords = {
    {{RenderPlace::kAuto, "auto"}, {RenderPlace::kKeep, "keep"}, {RenderPlace::kTraining, "training"}}};
constexpr ChoiceWords<RenderFrame, 2> kFrameWords = {{{RenderFrame::kCrop, "crop"}, {RenderFrame::kCamera, "camera"}}};

using dataset::Coco19Pose;
using geometry::RigCamera;

std::vector<Coco19Pose> TrainingPoses(const RunConfig& config, const dataset::PanopticDataset& data) {
  std::vector<Coco19Pose> poses;
  for (const int frame : config.split.train_frames) {
    const auto people = data.poses.find(frame);
    if (people == data.poses.end()) continue;
    const auto pose = people->second.find(config.pack.person);
    if (pose != people->second.end()) poses.push_back(pose->second);
  }
  if (poses.empty()) {
    throw UsageError("the dataset " + data.root +
                     " has none of the frames that the avatar was trained on; pass the right one with option 'dataset'");
  }
  return poses;
}

void CheckOptions(const RenderOptions& o) {
  const auto require = [](bool ok, const std::string& text) {
    if (!ok) throw UsageError(text);
  };
  require(o.poses.empty() || o.bvh.empty(), "option 'poses' and option 'bvh' exclude each other");
  require(!o.rest_pose || (o.poses.empty() && o.bvh.empty() && o.frames.empty()),
          "option 'rest-pose' is a pose: leave option 'poses', option 'bvh' and option 'frames' out");
  require(o.turntable >= 0 && o.turntable <= 100000, "option 'turntable' must be in 0..100000");
  require(o.turntable == 0 || (o.cameras.empty() && o.calib.empty()),
          "option 'turntable' has a camera of its own: leave option 'cameras' and option 'calib' out");
  require(o.turntable == 0 || o.frame == RenderFrame::kCrop, "option 'turntable' makes crops: leave option 'frame' out");
  require(o.elevation_deg == -1000 || std::abs(o.elevation_deg) < 90, "option 'elevation-deg' must be between -90 and 90");
  require(o.size_px == 0 || (o.size_px >= 8 && o.size_px <= 8192), "option 'size' must be 0 or in 8..8192");
  require(o.network_size_px >= 0 && o.network_size_px <= 8192, "option 'network-size' must be in 0..8192");
}

/// Frames of the dataset in which the person is not are left out, with a word; others that have no pose stay, to be refused.
std::vector<int> WithPerson(const dataset::PanopticDataset& data, const PoseTrack& track, const std::vector<int>& frames,
                            RenderPlan* plan) {
  std::vector<int> with;
  for (const int frame : frames) {
    if (!data.poses.count(frame) || std::binary_search(track.frames.begin(), track.frames.end(), frame)) {
      with.push_back(frame);
    } else {
      plan->skipped.push_back("frame " + std::to_string(frame) + ": the person is not in it");
    }
  }
  if (with.empty() && !frames.empty()) throw UsageError("the person is in none of the frames that were asked for");
  return with;
}

/// The body that the avatar sees: the person's own, or the template with their girths.
void TakeBody(const RunConfig& config, RenderPlan* plan) {
  if (config.pack.template_input_px == 0 && !config.pack.keep_views) return;
  plan->fitted = config.pack.fitted;
  if (!plan->fitted) plan->body = std::make_shared<const body::BodyTemplate>(ScaleGirth(body::MakeMannequin(), config.shape));
}

/// One pose: that of the body at rest.
PoseTrack RestTrack(const RenderPlan& plan) {
  const body::BodyTemplate body = plan.fitted ? plan.fitted->person.body : plan.body ? *plan.body : body::MakeMannequin();
  Coco19Pose pose;
  pose.x_in_world = body.coco19;
  pose.valid.fill(true), pose.confidence.fill(1);
  PoseTrack track;
  track.source = "the body at rest", track.frames = {0}, track.poses = {pose};
  return track;
}

/// The poses asked for and, of other people, in the trained person's size and place.
void TakePoses(const RunConfig& config, const dataset::PanopticDataset& data, const RenderOptions& o, RenderPlan* plan) {
  plan->foreign = !o.poses.empty() || !o.bvh.empty() || o.rest_pose;
  if (!plan->foreign) {
    const std::vector<int>& usual = config.split.holdout_frames;
    const PoseTrack track = TrackOf(data, config.pack.person);
    plan->track = SelectFrames(track, WithPerson(data, track, o.frames.empty() ? usual : o.frames, plan), o.every);
    return;
  }
  const std::vector<Coco19Pose> training = TrainingPoses(config, data);
  const SkeletonSize trained = MeasureSkeleton(training);
  if (o.rest_pose) {
    plan->track = RestTrack(*plan);
    Shift(&plan->track, trained.ground - MeasureSkeleton(plan->track.poses).ground);
    return;
  }
  PoseTrack track =
      o.bvh.empty() ? ReadPoseTrack(o.poses, o.pose_person) : PosesFromBvh(ReadBvh(o.bvh), MeasureHead(training), o.bvh);
  const SkeletonSize own = MeasureSkeleton(track.poses);
  plan->ratio = SizeRatio(trained, own, track.source);
  plan->scaled = o.scale_normalise == ScaleNormalise::kOn;
  if (plan->scaled) {
    for (Coco19Pose& pose : track.poses) pose = NormaliseScale(pose, trained, plan->ratio);
  }
  if (o.place == RenderPlace::kTraining || (o.place == RenderPlace::kAuto && !o.bvh.empty()))
    Shift(&track, trained.ground - MeasureSkeleton(track.poses).ground);
  plan->track = SelectFrames(track, o.frames, o.every);
}

/// All joints that the network wants.
void TakeJoints(const RunConfig& config, const dataset::PanopticDataset& data, RenderPlan* plan) {
  const int count = config.pack.num_joints;
  if (plan->foreign) {
    for (const Coco19Pose& pose : plan->track.poses) plan->joints.push_back(BodyAlone(pose, count));
    return;
  }
  const JointSource source(data, config.pack.person, count, config.pack.pose3d, plan->track.frames);
  for (size_t i = 0; i < plan->track.poses.size(); ++i)
    plan->joints.push_back(source.At(plan->track.frames[i], plan->track.poses[i]));
}

RigCamera CameraNamed(const geometry::Rig& rig, const std::string& name, const std::string& where) {
  const int found = rig.Find(name);
  if (found >= 0) return rig.cameras[found];
  throw UsageError("camera '" + name + "' is not in " + where + "; it has " + Join(geometry::CameraNames(rig), ", "));
}

/// By its name in the dataset or in the studio.
RigCamera CameraNamed(const dataset::PanopticDataset& data, const std::string& name) {
  const int found = data.rig.Find(data.Resolve(name));
  if (found >= 0) return data.rig.cameras[found];
  const auto known = [&](const std::string& camera) { return dataset::StudioName(data, camera); };
  throw UsageError("camera '" + name + "' is not in the dataset " + data.root + "; it has " +
                   Join(geometry::CameraNames(data.rig), ", ", known));
}

std::vector<RigCamera> ChooseCameras(const RunConfig& config, const dataset::PanopticDataset& data, const RenderOptions& o) {
  const std::vector<std::string> asked = SplitCommas(o.cameras);
  std::vector<RigCamera> cameras;
  if (!o.calib.empty()) {
    const geometry::Rig rig = dataset::ReadAnyCalibration(o.calib);
    for (const std::string& name : asked) cameras.push_back(CameraNamed(rig, name, o.calib));
    return asked.empty() ? rig.cameras : cameras;
  }
  for (const std::string& name : asked) cameras.push_back(CameraNamed(data, name));
  if (!asked.empty()) return cameras;
  for (const std::string& name : config.split.holdout_cameras) cameras.push_back(CameraNamed(data, name));
  return cameras.empty() ? data.rig.cameras : cameras;
}

/// Adds the job, or says why there is none.
void AddJob(const RunConfig& config, int size_px, RenderJob job, RenderPlan* plan) {
  const auto extent = dataset::MeasurePerson(plan->track.poses[job.pose], job.camera);
  if (!extent) {
    plan->skipped.push_back("camera " + job.view + ", frame " + std::to_string(job.frame) +
                            ": the person is not in front of the camera");
    return;
  }
  if (plan->HasBody() && !plan->Vertices(plan->track.poses[job.pose])) {
    plan->skipped.push_back("camera " + job.view + ", frame " + std::to_string(job.frame) +
                            ": neck, shoulders and hips do not fix the trunk of the body template that the network needs");
    return;
  }
  job.crop = dataset::CropCamera(job.camera, extent->middle_in_cam, config.half_extent_m, config.pack.fill, size_px);
  plan->jobs.push_back(std::move(job));
}

Eigen::Vector3d MiddleOf(const Coco19Pose& pose) {
  const std::array<bool, 19> plausible = dataset::PlausibleJoints(pose);
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (int j = 0; j < 19; ++j) {
    if (plausible[j]) low = low.cwiseMin(pose.x_in_world.col(j)), high = high.cwiseMax(pose.x_in_world.col(j));
  }
  return (low + high) / 2;
}

/// Where the turning camera starts and how it stands, like the training cameras.
struct Orbit {
  double azimuth_rad = 0, elevation_rad = 0, distance_m = 3;
};
Orbit OrbitLikeTraining(const RunConfig& config, const dataset::PanopticDataset& data, const RenderOptions& o) {
  const SkeletonSize trained = MeasureSkeleton(TrainingPoses(config, data));
  const Eigen::Vector3d middle = trained.ground + Eigen::Vector3d(0, 0, 0.9);
  std::vector<double> elevations, distances;
  Orbit orbit;
  for (const std::string& name : config.split.train_cameras) {
    const Eigen::Vector3d from = CameraNamed(data, name).CenterInWorld() - middle;
    if (distances.empty()) orbit.azimuth_rad = std::atan2(from.y(), from.x());
    distances.push_back(from.norm());
    elevations.push_back(std::atan2(from.z(), std::hypot(from.x(), from.y())));
  }
  orbit.distance_m = UpperMedian(distances);
  orbit.elevation_rad = o.elevation_deg == -1000 ? UpperMedian(elevations) : DegToRad(o.elevation_deg);
  return orbit;
}

void PlanTurntable(const RunConfig& config, const dataset::PanopticDataset& data, const RenderOptions& o, RenderPlan* plan) {
  const Orbit orbit = OrbitLikeTraining(config, data, o);
  const size_t count = plan->track.poses.size();
  for (int k = 0; k < o.turntable; ++k) {
    RenderJob job;
    job.view = "turn", job.frame = k;
    job.pose = static_cast<size_t>(k) * count / static_cast<size_t>(o.turntable);
    const Eigen::Vector3d middle = MiddleOf(plan->track.poses[job.pose]);
    if (!middle.allFinite()) {
      plan->skipped.push_back("image " + std::to_string(k) + ": the pose has no joints");
      continue;
    }
    const double azimuth = orbit.azimuth_rad + 2 * kPi * k / o.turntable;
    job.camera = OrbitCamera(middle, azimuth, orbit.elevation_rad, orbit.distance_m, config.pack.size_px);
    AddJob(config, config.pack.size_px, job, plan);
  }
}

}  // namespace

std::string_view ToString(ScaleNormalise scale) { return WordOf(kScaleWords, scale); }
std::string_view ToString(RenderPlace place) { return WordOf(kPlaceWords, place); }
std::string_view ToString(RenderFrame frame) { return WordOf(kFrameWords, frame); }

void FromString(const std::string& text, ScaleNormalise* scale) {
  *scale = KnownChoice(kScaleWords, text, "option 'scale-normalise' must be on or off");
}

void FromString(const std::string& text, RenderPlace* place) {
  *place = KnownChoice(kPlaceWords, text, "option 'place' must be auto, keep or training");
}

void FromString(const std::string& text, RenderFrame* frame) {
  *frame = KnownChoice(kFrameWords, text, "option 'frame' must be crop or camera");
}

RigCamera OrbitCamera(const Eigen::Vector3d& middle_in_world, double azimuth_rad, double elevation_rad, double distance_m,
                      int size_px) {
  const Eigen::Vector3d out(std::cos(elevation_rad) * std::cos(azimuth_rad), std::cos(elevation_rad) * std::sin(azimuth_rad),
                            std::sin(elevation_rad));
  const Eigen::Vector3d forward = -out, right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d axes;  // rows: camera axes in world
  axes << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  RigCamera camera;
  camera.camera = geometry::MakePinhole("turn", size_px, size_px, size_px);
  camera.cam_from_world.rotation = geometry::NearestRotation(axes);
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * (middle_in_world + distance_m * out));
  return camera;
}

std::optional<Eigen::Matrix3Xf> RenderPlan::Vertices(const dataset::Coco19Pose& pose) const {
  return fitted ? PosedVertices(fitted->person, pose) : PosedVertices(*body, pose);
}

RenderPlan MakeRenderPlan(const RunConfig& config, const dataset::PanopticDataset& data, const RenderOptions& options) {
  CheckOptions(options);
  RenderPlan plan;
  TakeBody(config, &plan);
  TakePoses(config, data, options, &plan);
  TakeJoints(config, data, &plan);
  plan.rate_hz = plan.track.rate_hz / std::max(1, UsualStep(plan.track.frames));
  if (options.turntable > 0) {
    const bool moves = plan.track.poses.size() > 1;
    if (moves) plan.rate_hz *= static_cast<double>(options.turntable) / static_cast<double>(plan.track.poses.size());
    if (!moves) plan.rate_hz = 0;
    PlanTurntable(config, data, options, &plan);
  } else {
    for (const RigCamera& camera : ChooseCameras(config, data, options)) {
      const std::string& name = camera.camera.name;
      const std::string view = dataset::Slug(options.calib.empty() ? dataset::StudioName(data, name) : name);
      for (size_t i = 0; i < plan.track.poses.size(); ++i)
        AddJob(config, config.pack.size_px, {view, plan.track.frames[i], i, camera, {}}, &plan);
    }
  }
  if (plan.jobs.empty()) {
    throw FormatError(plan.track.source, "",
                      "nothing can be rendered" + (plan.skipped.empty() ? std::string() : "; " + plan.skipped.front()));
  }
  return plan;
}

}  // namespace mvstudio::avatar
