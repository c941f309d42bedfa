#include <optional>

#include "core/disk/output.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/footage/frame_rate.h"
#include "stages/input/first_frames.h"
#include "stages/input/pose3d_input.h"
#include "stages/input/score_input.h"
#include "stages/nets/lift/run.h"

namespace mvstudio::stages {
namespace {

using LiftTruth = std::map<int, dataset::Coco19Pose>;

/// The surest person of an image.
const dataset::Person2d* Surest(const std::vector<dataset::Person2d>& people) {
  const dataset::Person2d* best = nullptr;
  double most = 0;
  for (const dataset::Person2d& person : people) {
    double sum = 0;
    for (const dataset::Keypoint2d& k : person.keypoints) sum += k.score;
    if (!best || sum > most) best = &person, most = sum;
  }
  return best;
}

/// Every frame from the first to the last; those without a person have no joints.
std::map<int, avatar::LiftView> ReadViews(const LiftApplyOptions& options, const geometry::Rig& rig,
                                          const geometry::Camera& camera, InputNotes* notes) {
  const geometry::Skeleton skeleton = geometry::SkeletonFrom(options.skeleton);
  std::vector<dataset::Pose2dTrack> tracks = {dataset::ReadPose2d(options.pose2d, options.camera, skeleton)};
  LimitFrames(options.changes, &tracks, notes);
  NumberFromZero(options.changes, {}, &tracks, notes);
  ScoresToShares(options.changes, false, &tracks, notes);
  ApplyChanges(options.changes, rig, skeleton, &tracks);
  if (tracks.empty()) throw UsageError("option 'without-camera' " + options.camera + ": it is the only one here");
  const geometry::Projector projector(camera);
  std::map<int, avatar::LiftView> views;
  for (const auto& [frame, people] : tracks[0].frames) {
    avatar::LiftView& view = views[frame];
    const dataset::Person2d* found = Surest(people);
    if (!found) continue;
    dataset::Person2d person = *found;
    for (dataset::Keypoint2d& k : person.keypoints) {
      if (k.score < options.min_score) k.score = 0;
    }
    view = avatar::ViewOf(projector, person, skeleton);
  }
  return views;
}

LiftTruth ReadTruth(const std::string& path, const std::string& marker_unit) {
  LiftTruth truth;
  for (const auto& [frame, people] : ReadCoco19Poses(path, marker_unit)) {
    if (!people.empty()) truth[frame] = people.begin()->second;
  }
  if (truth.empty()) throw FormatError(path, "", "option 'truth' holds nobody");
  return truth;
}

double SizeFor(const LiftApplyOptions& options, const avatar::Lifter& lifter) {
  if (options.height_m < 0 || options.height_m > 3) throw UsageError("option 'height-m' must be 0 to 3");
  return options.height_m > 0 ? avatar::kSizePerHeight * options.height_m : lifter.size_m;
}

void CheckLift(const LiftApplyOptions& options) {
  if (!(options.smooth >= 0 && options.smooth <= 100)) throw UsageError("option 'smooth' must be 0 to 100");
  if (options.stride < 1) throw UsageError("option 'stride' must be 1 or more");
}

const geometry::RigCamera& CameraOf(const geometry::Rig& rig, const LiftApplyOptions& options) {
  const int index = rig.Find(options.camera);
  if (index < 0) {
    throw UsageError("option 'camera' " + options.camera + " is not in " + options.calib + "; it has " +
                     Join(geometry::CameraNames(rig), ", "));
  }
  return rig.cameras[static_cast<size_t>(index)];
}

}  // namespace

LiftApplyReport RunLiftApply(const LiftApplyOptions& options) {
  CheckLift(options);
  const avatar::Lifter lifter = avatar::LoadLifter(options.lifter);
  if (options.rate_hz != 0 && !dataset::IsFrameRate(options.rate_hz))
    throw UsageError(std::string("option 'frame-rate' ") + dataset::kFrameRates);
  const calib::ImportedRig imported = ReadCalibrationFiles({options.calib}, options.read);
  const geometry::RigCamera& camera = CameraOf(imported.rig, options);
  LiftApplyReport report;
  report.folder = options.out, report.size_m = SizeFor(options, lifter);
  report.notes.inputs = {options.pose2d, options.lifter, options.calib};
  AddNotes(imported.notes, &report.notes);
  const OutputFolder place(options.out, report.notes.inputs, {"points.csv", "covariance.csv", "pose3d.json"});
  std::optional<Eigen::Vector3d> up;
  if (options.level) up = camera.cam_from_world.rotation * Eigen::Vector3d::UnitZ();
  const auto views = ReadViews(options, imported.rig, camera.camera, &report.notes);
  const auto inputs = avatar::LiftInputs(views, options.stride, up);
  report.frames = avatar::LiftTake(lifter, inputs, report.size_m, PinholeOf(camera.camera).fx());
  avatar::SmoothTake(options.smooth, &report.frames);
  dataset::Pose3d pose = avatar::ToPose3d(report.frames, camera.cam_from_world, lifter.sigma_m);
  report.rate_hz = pose.frame_rate_hz = options.rate_hz != 0 ? options.rate_hz : StepRateHz(options.changes);
  WritePose3d(pose, options.out);
  if (options.truth.empty()) return report;
  const LiftTruth truth = ReadTruth(options.truth, options.marker_unit);
  report.truth = avatar::ScoreLift({PairsOf(report.frames, truth, camera.cam_from_world)}, true);
  report.notes.inputs.push_back(options.truth);
  return report;
}

}  // namespace mvstudio::stages
