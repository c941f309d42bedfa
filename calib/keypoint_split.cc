#include "calib/keypoint_split.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "core/error.h"
#include "core/units.h"

namespace mvstudio::calib {
namespace {

constexpr int kMinSharedJoints = 12;  // of a camera with another: more than its pose has numbers
constexpr int kMinFrames = 4;

/// Cameras that share joints with others, as one group; names of those that do not.
std::vector<std::string> Unconnected(const geometry::Rig& rig, const std::vector<KeypointJoint>& joints) {
  const size_t n = rig.cameras.size();
  Eigen::MatrixXi shared = Eigen::MatrixXi::Zero(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  for (const KeypointJoint& joint : joints)
    for (const auto& a : joint.seen)
      for (const auto& b : joint.seen) shared(a.camera_idx, b.camera_idx) += 1;
  std::vector<bool> reached(n, false);
  std::vector<Eigen::Index> queue;
  Eigen::Index start = 0;
  for (Eigen::Index c = 1; c < shared.rows(); ++c)
    if (shared(c, c) > shared(start, start)) start = c;
  reached[static_cast<size_t>(start)] = true, queue.push_back(start);
  while (!queue.empty()) {
    const Eigen::Index at = queue.back();
    queue.pop_back();
    for (Eigen::Index c = 0; c < shared.rows(); ++c) {
      if (reached[static_cast<size_t>(c)] || shared(at, c) < kMinSharedJoints) continue;
      reached[static_cast<size_t>(c)] = true, queue.push_back(c);
    }
  }
  std::vector<std::string> names;
  for (size_t c = 0; c < n; ++c)
    if (!reached[c]) names.push_back(rig.cameras[c].camera.name);
  return names;
}

std::string List(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace

Eigen::Vector3d MeanCentre(const geometry::Rig& rig) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const geometry::RigCamera& camera : rig.cameras)
    mean += camera.CenterInWorld() / static_cast<double>(rig.cameras.size());
  return mean;
}

KeypointSplit SplitKeypoints(const std::vector<KeypointJoint>& joints, const std::optional<FrameChoice>& train,
                             const std::optional<FrameChoice>& test, int max_frames) {
  std::map<int, size_t> rank;
  for (const int frame : FramesOf(joints)) rank.emplace(frame, rank.size());
  KeypointSplit split;
  for (const KeypointJoint& joint : joints) {
    const bool even = rank[joint.frame] % 2 == 0;
    const bool in_test = test ? test->Contains(joint.frame) : train ? !train->Contains(joint.frame) : !even;
    const bool in_train = train ? train->Contains(joint.frame) : test ? !in_test : even;
    if (in_train && in_test) throw UsageError("--train-frames and --test-frames share frame " + std::to_string(joint.frame));
    if (in_train) split.train.push_back(joint);
    if (in_test) split.test.push_back(joint);
  }
  split.train = Thinned(split.train, max_frames);
  return split;
}

std::string WhyTooFew(const geometry::Rig& rig, const KeypointSplit& split) {
  const auto num_train = FramesOf(split.train).size();
  if (num_train < kMinFrames)
    return "people are seen by two cameras at once in " + std::to_string(num_train) + " of the train frames; at least " +
           std::to_string(kMinFrames) + " are needed";
  if (FramesOf(split.test).empty()) return "no joint is seen by two cameras at once in the test frames";
  const std::vector<std::string> alone = Unconnected(rig, split.train);
  if (!alone.empty()) return "cameras without enough joints that others see too: " + List(alone);
  return "";
}

std::string WhyLoose(const geometry::Rig& rig, const KeypointCovariance& covariance) {
  if (covariance.status != Status::kOk) return covariance.message;
  constexpr double kMaxOfSpread = 0.1, kMaxRad = 0.1;
  const Eigen::Vector3d mean = MeanCentre(rig);
  double spread = 0;
  for (const geometry::RigCamera& camera : rig.cameras) spread = std::max(spread, (camera.CenterInWorld() - mean).norm());
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Eigen::Index row = covariance.begin[c + 1] - 6;
    const Eigen::Matrix<double, 6, 6> pose = covariance.from_joints.block<6, 6>(row, row);
    const double place = std::sqrt(CentreCovariance(rig.cameras[c].cam_from_world, pose).trace());
    const double turn = std::sqrt(pose.topLeftCorner<3, 3>().trace());
    if (place < kMaxOfSpread * spread && turn < kMaxRad) continue;
    char text[300];
    std::snprintf(text, sizeof text,
                  "the joints leave camera %s uncertain by %.0f mm and %.1f deg: people must move through more of the space",
                  rig.cameras[c].camera.name.c_str(), 1e3 * place, RadToDeg(turn));
    return text;
  }
  return "";
}

}  // namespace mvstudio::calib
