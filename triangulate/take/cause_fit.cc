#include "triangulate/take/cause_fit.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/parallel.h"
#include "triangulate/point/point.h"

namespace mvstudio::triangulate::internal {
namespace {

bool IsSeen(const Keypoint& key, double min_score) { return key.score > 0 && key.score >= min_score && key.px.allFinite(); }

/// Who is who in one frame by this rig; in a frame with one person an image there is nothing to choose.
std::vector<std::vector<int>> Choices(const PreparedRig& rig, const DetectedFrame& frame, const Judge& judge) {
  const bool crowd =
      std::any_of(frame.people.begin(), frame.people.end(), [](const auto& people) { return people.size() > 1; });
  if (!crowd) {
    std::vector<int> choice;
    for (const auto& people : frame.people) choice.push_back(people.empty() ? -1 : 0);
    return {choice};
  }
  AssociationOptions options;
  options.min_score = judge.options.min_score;
  options.max_persons = judge.options.max_persons;
  options.sigma_px = judge.sigma_px;
  std::vector<std::vector<int>> choices;
  for (const Cluster& cluster : AssociateFrame(rig, frame, options)) {
    if (static_cast<int>(choices.size()) < judge.options.max_persons) choices.push_back(cluster.choice);
  }
  return choices;
}

/// The joint's place, where it has one.
std::optional<Eigen::Vector3d> FitJoint(const PreparedRig& rig, const DetectedFrame& frame, const std::vector<int>& choice,
                                        size_t joint_idx, const Judge& judge, FrameFit* fit) {
  std::vector<Observation> seen;
  for (size_t c = 0; c < choice.size(); ++c) {
    if (choice[c] < 0) continue;
    const DetectedPerson& person = frame.people[c][static_cast<size_t>(choice[c])];
    if (joint_idx >= person.size() || !IsSeen(person[joint_idx], judge.options.min_score)) continue;
    seen.push_back({static_cast<int>(c), person[joint_idx].px, judge.sigma_px, 1});
  }
  PointOptions options;
  options.min_views = judge.min_views;
  options.max_hypotheses = 60;
  const Point point = TriangulatePoint(rig, seen, options);
  if (point.status != Status::kOk || static_cast<int>(point.used.size()) < judge.min_views) return std::nullopt;
  for (const int i : point.used) {
    const Observation& view = seen[static_cast<size_t>(i)];
    const PreparedCamera& camera = rig.cameras[static_cast<size_t>(view.camera_idx)];
    const auto at = camera.projector.Project(camera.ToCam(point.x_in_world - rig.origin_in_world));
    if (at.status != Status::kOk) continue;
    ++fit->carried;
    fit->cost_px += std::min((view.px - at.px).norm(), judge.limit_px());
  }
  return point.x_in_world;
}

/// Above 0: left and right of a person are where they belong; below: the person is a mirror image; 0: not known.
double HandednessOf(const BodySides& sides, const std::vector<std::optional<Eigen::Vector3d>>& joints) {
  const auto at = [&](int joint) {
    return joint >= 0 && static_cast<size_t>(joint) < joints.size() ? joints[static_cast<size_t>(joint)] : std::nullopt;
  };
  const auto nose = at(sides.nose), left = at(sides.left_shoulder), right = at(sides.right_shoulder),
             left_hip = at(sides.left_hip), right_hip = at(sides.right_hip);
  if (!nose || !left || !right || !left_hip || !right_hip) return 0;
  const Eigen::Vector3d shoulders = 0.5 * (*left + *right), up = shoulders - 0.5 * (*left_hip + *right_hip);
  return (*nose - shoulders).dot((*left - *right).cross(up));
}

FrameFit FitFrame(const PreparedRig& rig, const DetectedFrame& frame, const Judge& judge) {
  FrameFit fit;
  const auto counts = CountSeen(frame, judge.options.min_score, judge.options.max_persons);
  for (const std::vector<int>& of_joint : counts) {
    const int persons = PersonsOf(of_joint, judge.min_views);
    for (const int count : of_joint) fit.offered += std::min(count, persons);
  }
  for (const std::vector<int>& choice : Choices(rig, frame, judge)) {
    std::vector<std::optional<Eigen::Vector3d>> joints;
    for (size_t j = 0; j < counts.size(); ++j) joints.push_back(FitJoint(rig, frame, choice, j, judge, &fit));
    const double handedness = HandednessOf(judge.sides, joints);
    fit.upright += handedness > 0, fit.mirrored += handedness < 0;
  }
  fit.carried = std::min(fit.carried, fit.offered);
  fit.cost_px += judge.limit_px() * (fit.offered - fit.carried);
  return fit;
}

}  // namespace

std::vector<std::vector<int>> CountSeen(const DetectedFrame& frame, double min_score, int max_persons) {
  std::vector<std::vector<int>> counts;
  for (size_t c = 0; c < frame.people.size(); ++c) {
    for (const DetectedPerson& person : frame.people[c]) {
      if (counts.size() < person.size()) counts.resize(person.size(), std::vector<int>(frame.people.size(), 0));
      for (size_t j = 0; j < person.size(); ++j) counts[j][c] += IsSeen(person[j], min_score);
    }
  }
  for (std::vector<int>& of_joint : counts) {
    for (int& count : of_joint) count = std::min(count, max_persons);
    std::sort(of_joint.rbegin(), of_joint.rend());
  }
  return counts;
}

int PersonsOf(const std::vector<int>& sorted_counts, int min_views) {
  return static_cast<int>(sorted_counts.size()) < min_views ? 0 : sorted_counts[static_cast<size_t>(min_views) - 1];
}

std::vector<FrameFit> FitFrames(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const Judge& judge) {
  const PreparedRig prepared = Prepare(rig);
  std::vector<FrameFit> fits(frames.size());
  ParallelFor(static_cast<int64_t>(frames.size()), judge.num_threads,
              [&](int64_t f) { fits[static_cast<size_t>(f)] = FitFrame(prepared, frames[static_cast<size_t>(f)], judge); });
  return fits;
}

}  // namespace mvstudio::triangulate::internal
