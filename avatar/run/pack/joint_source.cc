#include "avatar/run/pack/joint_source.h"

#include <set>

#include "avatar/maps/bone_lists.h"
#include "core/check.h"
#include "dataset/panoptic/sequence.h"
#include "dataset/views/crop.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::avatar {
namespace {

constexpr double kMinScore = 0.05;
constexpr double kMaxReachM = 0.35;  // of a face from the nose, of a hand from the wrist, of a foot from the ankle

/// Names of a list's joints, OpenPose's.
std::vector<std::string> NamesOf(int num_joints) {
  const geometry::Skeleton& whole = geometry::SkeletonByName("openpose137");
  std::vector<std::string> names = NumBodyJoints(num_joints) == 19
                                       ? geometry::Coco19().joints
                                       : std::vector<std::string>(whole.joints.begin(), whole.joints.begin() + 25);
  if (num_joints > 25) names.insert(names.end(), whole.joints.begin() + 25, whole.joints.end());
  MVS_CHECK(static_cast<int>(names.size()) == num_joints, num_joints << " joints are no list");
  return names;
}

int IndexOf(const std::vector<std::string>& names, const std::string& name) {
  for (size_t j = 0; j < names.size(); ++j) {
    if (names[j] == name) return static_cast<int>(j);
  }
  return -1;
}

/// The joint of the body that a point of the face, a hand or a foot must be near; -1: none.
int AnchorOf(int joint, int num_joints) {
  const int body = NumBodyJoints(num_joints), extra = joint - body;
  const bool panoptic = body == 19;
  if (extra < 0 && (panoptic || joint < 19)) return -1;
  if (extra < 0) return joint < 22 ? 14 : 11;  // BODY_25: toes and heel of the left foot, then of the right
  if (extra < kFaceJoints) return panoptic ? 1 : 0;
  const bool left = extra < kFaceJoints + kHandJoints;
  return panoptic ? (left ? 5 : 11) : (left ? 7 : 4);
}

}  // namespace

FullPose BodyAlone(const dataset::Coco19Pose& pose, int num_joints) {
  const std::array<bool, 19> plausible = dataset::PlausibleJoints(pose);
  FullPose full;
  full.x_in_world = Eigen::Matrix3Xd::Zero(3, num_joints);
  full.valid.assign(static_cast<size_t>(num_joints), false);
  static const std::vector<std::string> body25 = NamesOf(25);
  for (int j = 0; j < 19; ++j) {
    const int to = NumBodyJoints(num_joints) == 19 ? j : IndexOf(body25, geometry::Coco19().joints[j]);
    full.valid[to] = plausible[j];
    if (plausible[j]) full.x_in_world.col(to) = pose.x_in_world.col(j);
  }
  return full;
}

JointSource::JointSource(const dataset::PanopticDataset& data, int person, int num_joints, const std::string& pose3d,
                         const std::vector<int>& frames)
    : num_joints_(num_joints) {
  if (num_joints > 25) ReadLandmarks(data, person, frames);
  if (num_joints > 19 && !pose3d.empty()) ReadTable(pose3d, person);
}

void JointSource::ReadLandmarks(const dataset::PanopticDataset& data, int person, const std::vector<int>& frames) {
  const dataset::PanopticSequence sequence = dataset::ScanPanopticSequence(data.root);
  const int face = NumBodyJoints(num_joints_), left = face + kFaceJoints, right = left + kHandJoints;
  const auto take = [&](int frame, const std::optional<dataset::PanopticLandmarks>& points, int first, int count) {
    if (!points || points->landmarks_cm.size() != static_cast<size_t>(3 * count)) return;
    const Eigen::Matrix3Xd x = dataset::InWorld(*points).cast<double>();
    for (int k = 0; k < count; ++k) {
      if (points->average_score && (*points->average_score)[k] <= kMinScore) continue;
      found_[frame].x_in_world[first + k] = x.col(k);
    }
  };
  const std::set<int> wanted(frames.begin(), frames.end());
  for (const dataset::PanopticFrames* source : {&sequence.faces, &sequence.hands}) {
    for (const auto& [frame, path] : source->files) {
      if (!wanted.count(frame)) continue;
      for (const dataset::PanopticLandmarkPerson& one : dataset::ReadPanopticLandmarks(path).people) {
        if (one.id != person) continue;
        take(frame, one.face70, face, kFaceJoints);
        take(frame, one.left_hand, left, kHandJoints);
        take(frame, one.right_hand, right, kHandJoints);
      }
    }
  }
}

void JointSource::ReadTable(const std::string& folder, int person) {
  const std::vector<std::string> names = NamesOf(num_joints_);
  static const std::vector<std::string> body = geometry::Coco19().joints;
  for (const dataset::JointRow& row : dataset::ReadPose3d(folder).rows) {
    const int joint = IndexOf(names, row.joint);
    if (joint < 0 || row.person != person || row.status != Status::kOk || IndexOf(body, row.joint) >= 0) continue;
    found_[row.frame].x_in_world[joint] = row.x_in_world;
  }
}

FullPose JointSource::At(int frame, const dataset::Coco19Pose& pose) const {
  FullPose full = BodyAlone(pose, num_joints_);
  const auto found = found_.find(frame);
  if (found == found_.end()) return full;
  for (const auto& [joint, x] : found->second.x_in_world) {
    const int anchor = AnchorOf(joint, num_joints_);
    const bool near = anchor < 0 || !full.valid[anchor] || (x - full.x_in_world.col(anchor)).norm() <= kMaxReachM;
    if (!near || !x.allFinite()) continue;
    full.x_in_world.col(joint) = x;
    full.valid[joint] = true;
  }
  return full;
}

}  // namespace mvstudio::avatar
