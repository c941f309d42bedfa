#include "calib/keypoints/take.h"

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

bool IsPresent(const std::vector<int>& chosen) {
  return std::any_of(chosen.begin(), chosen.end(), [](int detection) { return detection >= 0; });
}

/// Options that let nobody of the take go: a person in two views of one frame is no more than half of its detections.
triangulate::AssociationOptions OfAll(const std::vector<triangulate::DetectedFrame>& frames,
                                      triangulate::AssociationOptions options) {
  size_t most = 0, num_joints = 0;
  for (const triangulate::DetectedFrame& frame : frames) {
    size_t count = 0;
    for (const auto& people : frame.people) count += people.size();
    most = std::max(most, count / 2), num_joints = std::max(num_joints, NumJoints(frame));
  }
  options.max_persons = std::max(options.max_persons, static_cast<int>(most));
  options.min_joints = std::min(options.min_joints, static_cast<int>(std::max<size_t>(num_joints, 1)));
  return options;
}

}  // namespace

std::vector<KeypointJoint> CollectKeypoints(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                            const triangulate::AssociationOptions& options, const RunContext& run,
                                            LeftOutPersons* left_out) {
  const auto chosen = triangulate::AssociateTake(triangulate::Prepare(rig), frames, OfAll(frames, options), run);
  std::vector<KeypointJoint> joints;
  LeftOutPersons others;
  for (size_t f = 0; f < frames.size(); ++f) {
    const size_t num_joints = NumJoints(frames[f]);
    int num_present = 0;
    for (size_t person = 0; person < chosen[f].size(); ++person) {
      if (!IsPresent(chosen[f][person]) || ++num_present > options.max_persons) continue;
      for (size_t j = 0; j < num_joints; ++j) {
        KeypointJoint joint = Observe(frames[f], chosen[f][person], j, options.min_score);
        joint.person = static_cast<int>(person);
        if (joint.seen.size() >= 2) joints.push_back(std::move(joint));
      }
    }
    if (num_present <= options.max_persons) continue;
    others.frames.push_back(frames[f].frame);
    others.num_persons = std::max(others.num_persons, num_present - options.max_persons);
  }
  if (left_out) *left_out = std::move(others);
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

size_t NumObservations(const std::vector<KeypointJoint>& joints) {
  size_t count = 0;
  for (const KeypointJoint& joint : joints) count += joint.seen.size();
  return count;
}

std::vector<KeypointJoint> ThinnedTo(const std::vector<KeypointJoint>& joints, size_t max_observations) {
  const size_t count = NumObservations(joints);
  if (count <= max_observations) return joints;
  constexpr double kFewest = 20;
  const double share = static_cast<double>(max_observations) / static_cast<double>(count);
  return Thinned(joints, static_cast<int>(std::max(kFewest, share * static_cast<double>(FramesOf(joints).size()))));
}

}  // namespace mvstudio::calib
