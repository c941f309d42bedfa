#include "calib/keypoint_take.h"

#include <algorithm>
#include <set>

namespace mvstudio::calib {
namespace {

size_t NumJoints(const triangulate::DetectedFrame& frame) {
  for (const auto& people : frame.people)
    if (!people.empty()) return people.front().size();
  return 0;
}

KeypointJoint Observe(const triangulate::DetectedFrame& frame, const std::vector<int>& chosen, size_t joint_idx,
                      double min_score) {
  KeypointJoint joint{frame.frame, 0, static_cast<int>(joint_idx), {}};
  for (size_t c = 0; c < chosen.size(); ++c) {
    if (chosen[c] < 0) continue;
    const triangulate::Keypoint& key = frame.people[c][static_cast<size_t>(chosen[c])][joint_idx];
    if (!(key.score > 0) || key.score < min_score || !key.px.allFinite()) continue;
    triangulate::Observation seen;
    seen.camera_idx = static_cast<int>(c), seen.px = key.px, seen.score = key.score;
    joint.seen.push_back(seen);
  }
  return joint;
}

}  // namespace

std::vector<KeypointJoint> CollectKeypoints(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                            const triangulate::AssociationOptions& options, const RunContext& run) {
  const auto chosen = triangulate::AssociateTake(triangulate::Prepare(rig), frames, options, run);
  std::vector<KeypointJoint> joints;
  for (size_t f = 0; f < frames.size(); ++f) {
    const size_t num_joints = NumJoints(frames[f]);
    for (size_t person = 0; person < chosen[f].size(); ++person) {
      for (size_t j = 0; j < num_joints; ++j) {
        KeypointJoint joint = Observe(frames[f], chosen[f][person], j, options.min_score);
        joint.person = static_cast<int>(person);
        if (joint.seen.size() >= 2) joints.push_back(std::move(joint));
      }
    }
  }
  return joints;
}

std::vector<KeypointJoint> JointsIn(const std::vector<KeypointJoint>& joints, const FrameChoice& choice) {
  std::vector<KeypointJoint> chosen;
  std::copy_if(joints.begin(), joints.end(), std::back_inserter(chosen),
               [&](const KeypointJoint& joint) { return choice.Contains(joint.frame); });
  return chosen;
}

std::vector<int> FramesOf(const std::vector<KeypointJoint>& joints) {
  std::set<int> frames;
  for (const KeypointJoint& joint : joints) frames.insert(joint.frame);
  return {frames.begin(), frames.end()};
}

std::vector<KeypointJoint> Thinned(const std::vector<KeypointJoint>& joints, int max_frames) {
  const std::vector<int> frames = FramesOf(joints);
  const auto count = static_cast<int64_t>(frames.size());
  if (count <= max_frames) return joints;
  std::set<int> kept;
  for (int64_t i = 0; i < max_frames; ++i) kept.insert(frames[static_cast<size_t>(i * count / max_frames)]);
  std::vector<KeypointJoint> chosen;
  std::copy_if(joints.begin(), joints.end(), std::back_inserter(chosen),
               [&](const KeypointJoint& joint) { return kept.count(joint.frame) > 0; });
  return chosen;
}

}  // namespace mvstudio::calib
