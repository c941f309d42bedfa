#include "avatar/body/fit/person_skeleton.h"

#include "core/statistics.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;

/// The rest pose with stretched bones, as a pose.
BodyPose StretchedRest(const BodyTemplate& body, const std::vector<double>& stretch, double girth) {
  BodyPose pose;
  pose.bone_stretch = stretch, pose.girth = girth;
  pose.bone_transforms.resize(stretch.size());
  for (size_t b = 0; b < stretch.size(); ++b) {
    const int parent = body.bone_parents[b];
    if (parent < 0) continue;
    const Vector3d head = body.bone_heads.col(b), from = body.bone_heads.col(parent), d = head - from;
    const Vector3d along = (body.bone_tails.col(parent) - from).normalized();
    const Vector3d moved = girth * d + (stretch[parent] - girth) * along * along.dot(d);
    pose.bone_transforms[b].translation = pose.bone_transforms[parent] * from + moved - head;
  }
  return pose;
}

BodyTemplate Bake(const BodyTemplate& body, const BodyPose& rest) {
  BodyTemplate out = body;
  out.vertices = SkinVertices(body, rest);
  out.coco19 = PosedCoco19(body, rest);
  for (Eigen::Index b = 0; b < body.bone_heads.cols(); ++b) {
    const Vector3d head = body.bone_heads.col(b), bone = body.bone_tails.col(b) - head;
    out.bone_heads.col(b) = rest.bone_transforms[b] * head;
    out.bone_tails.col(b) = out.bone_heads.col(b) + rest.bone_stretch[b] * bone;
  }
  return out;
}

}  // namespace

BodyTemplate WithLengthsOf(const BodyTemplate& body, const std::vector<JointObservation>& steps) {
  const size_t count = body.bone_names.size();
  std::vector<std::vector<double>> stretch(count);
  std::vector<double> girth;
  for (const JointObservation& step : steps) {
    BodyPose pose;
    if (!PoseFromJoints(body, step.x_in_world, step.valid, &pose)) continue;
    for (size_t b = 0; b < count; ++b) stretch[b].push_back(pose.bone_stretch[b]);
    girth.push_back(pose.girth);
  }
  if (girth.empty()) return body;
  std::vector<double> medians(count);
  for (size_t b = 0; b < count; ++b) medians[b] = LinearQuantile(stretch[b], 0.5);
  return Bake(body, StretchedRest(body, medians, LinearQuantile(girth, 0.5)));
}

void MoveJointsToObserved(const std::vector<JointObservation>& steps, const std::vector<ArticulatedPose>& poses,
                          BodyTemplate* body) {
  constexpr double kPriorSteps = 5;  // the template's place counts as so many time steps
  std::vector<PosedBones> bones;
  for (const ArticulatedPose& pose : poses) bones.emplace_back(*body, pose);
  for (int j = 0; j < 19; ++j) {
    std::array<std::vector<double>, 3> seen;
    for (size_t i = 0; i < steps.size(); ++i) {
      if (!steps[i].valid[j]) continue;
      const geometry::Rigid3& bone = bones[i].pose().bone_transforms[body->coco19_bone[j]];
      const Vector3d x = geometry::Inverse(bone) * Vector3d(steps[i].x_in_world.col(j));
      for (int k = 0; k < 3; ++k) seen[k].push_back(x[k]);
    }
    const auto count = static_cast<double>(seen[0].size());
    if (count == 0) continue;
    for (int k = 0; k < 3; ++k) {
      body->coco19(k, j) += count / (count + kPriorSteps) * (LinearQuantile(seen[k], 0.5) - body->coco19(k, j));
    }
  }
}

double MedianJointError(const BodyTemplate& body, const std::vector<JointObservation>& steps,
                        const std::vector<ArticulatedPose>& poses) {
  std::vector<double> errors;
  for (size_t i = 0; i < steps.size(); ++i) {
    const Eigen::Matrix3Xd posed = PosedCoco19(body, ToBodyPose(body, poses[i]));
    for (int j = 0; j < 19; ++j) {
      if (steps[i].valid[j]) errors.push_back((posed.col(j) - steps[i].x_in_world.col(j)).norm());
    }
  }
  return LinearQuantile(errors, 0.5);
}

}  // namespace mvstudio::body
