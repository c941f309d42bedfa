#include "stages/people/pose2d_quality.h"

#include <cmath>
#include <limits>

#include "stages/input/pose_input.h"
#include "stages/input/take_frames.h"

namespace mvstudio::stages {
namespace {

struct OkCount {
  int ok = 0, tried = 0;
  double share() const { return tried ? static_cast<double>(ok) / tried : 0; }
};

std::vector<OkCount> CountOk(const triangulate::TakeResult& take, size_t num_joints) {
  std::vector<OkCount> counts(num_joints);
  for (const triangulate::TakePoint& point : take.points) {
    OkCount& count = counts[static_cast<size_t>(point.joint_idx)];
    ++count.tried;
    count.ok += point.point.status == Status::kOk;
  }
  return counts;
}

std::vector<PoseAgreement::OfCamera> OfCameras(const triangulate::TakeResult& take, const geometry::Rig& rig) {
  std::vector<PoseAgreement::OfCamera> cameras;
  for (size_t c = 0; c < rig.cameras.size() && c < take.holdout.cameras.size(); ++c) {
    if (take.holdout.cameras[c].num_samples > 0) cameras.push_back({rig.cameras[c].camera.name, take.holdout.cameras[c]});
  }
  return cameras;
}

std::vector<PoseAgreement::OfJoint> OfJoints(const triangulate::TakeResult& take, const std::vector<OkCount>& counts,
                                             const geometry::Skeleton& skeleton) {
  std::vector<PoseAgreement::OfJoint> joints;
  for (size_t j = 0; j < skeleton.joints.size(); ++j) {
    joints.push_back({skeleton.joints[j], counts[j].share(), {}});
    if (j < take.holdout.joints.size()) joints.back().figures = take.holdout.joints[j];
  }
  return joints;
}

}  // namespace

PoseAgreement MeasureAgreement(const std::vector<dataset::Pose2dTrack>& tracks, const geometry::Skeleton& skeleton,
                               const geometry::Rig& rig, int max_persons, const RunContext& run) {
  PoseAgreement agreement;
  agreement.median_px = agreement.p90_px = std::numeric_limits<double>::quiet_NaN();
  std::vector<dataset::Pose2dTrack> known;
  for (const dataset::Pose2dTrack& track : tracks) {
    if (rig.Find(track.camera) >= 0) known.push_back(track);
  }
  if (known.size() < 2) return agreement;
  triangulate::TakeOptions options;
  options.max_persons = max_persons;
  const triangulate::TakeResult take =
      triangulate::TriangulateTake(rig, ToFrames(known, rig, ""), BodyOf(skeleton), options, run);
  const std::vector<OkCount> counts = CountOk(take, skeleton.joints.size());
  OkCount all;
  for (const OkCount& count : counts) all.ok += count.ok, all.tried += count.tried;
  agreement.median_px = take.holdout.all.num_samples ? take.holdout.all.median_px : agreement.median_px;
  agreement.p90_px = take.holdout.all.num_samples ? take.holdout.all.p90_px : agreement.p90_px;
  agreement.share_ok = all.share();
  agreement.sigma_px = take.sigma_px;
  agreement.sides_fixed = take.sides.num_swapped;
  agreement.measured = true, agreement.method = take.method, agreement.all = take.holdout.all;
  agreement.cameras = OfCameras(take, rig);
  agreement.joints = OfJoints(take, counts, skeleton);
  return agreement;
}

}  // namespace mvstudio::stages
