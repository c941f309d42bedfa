#include <algorithm>
#include <array>
#include <cmath>

#include "core/statistics.h"
#include "dataset/masks/limbs.h"
#include "dataset/masks/mask_take.h"

namespace mvstudio::dataset {
namespace {

struct Joints2d {
  std::array<Eigen::Vector2d, 19> px;
  std::array<bool, 19> valid{};
};

Joints2d ToCoco19(const Person2d& person, const std::array<std::vector<int>, 19>& from) {
  Joints2d joints;
  for (int j = 0; j < 19; ++j) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    bool all = !from[j].empty();
    for (const int i : from[j]) {
      const bool there = i < int(person.keypoints.size()) && person.keypoints[i].score > 0;
      all = all && there && std::isfinite(person.keypoints[i].x_px) && std::isfinite(person.keypoints[i].y_px);
      if (all) sum += Eigen::Vector2d(person.keypoints[i].x_px, person.keypoints[i].y_px);
    }
    joints.valid[j] = all;
    joints.px[j] = all ? (sum / double(from[j].size())).eval() : Eigen::Vector2d::Zero();
  }
  return joints;
}

/// Foreshortening only makes limbs shorter, so the second longest beside its usual length tells the scale; 0 without two limbs.
double PxPerM(const Joints2d& joints) {
  struct Length {
    int a, b;
    double usual_m;
  };
  constexpr Length kLengths[] = {{0, 2, 0.52}, {3, 4, 0.29}, {4, 5, 0.25},   {9, 10, 0.29}, {10, 11, 0.25},
                                 {6, 7, 0.42}, {7, 8, 0.42}, {12, 13, 0.42}, {13, 14, 0.42}};
  std::vector<double> scales;
  for (const Length& l : kLengths) {
    if (joints.valid[l.a] && joints.valid[l.b]) scales.push_back((joints.px[l.a] - joints.px[l.b]).norm() / l.usual_m);
  }
  return scales.size() < 2 ? 0 : ValueOfRank(scales.begin(), scales.end(), static_cast<std::ptrdiff_t>(scales.size()) - 2);
}

void AddPerson(const Joints2d& joints, const MaskOptions& options, ProjectedBody* body) {
  const double px_per_m = PxPerM(joints);
  if (!(px_per_m > 1)) return;
  const auto add = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b, double radius_a_m, double radius_b_m) {
    const double scale = px_per_m * options.body_scale;
    body->limbs.push_back({a, b, radius_a_m * scale, radius_b_m * scale, px_per_m});
  };
  for (const internal::LimbShape& limb : internal::kLimbs) {
    if (joints.valid[limb.a] && joints.valid[limb.b])
      add(joints.px[limb.a], joints.px[limb.b], limb.radius_a_m, limb.radius_b_m);
  }
  const int head = joints.valid[16] ? 16 : joints.valid[18] ? 18 : 1;
  if (joints.valid[head]) {
    const Eigen::Vector2d middle =
        joints.valid[16] && joints.valid[18] ? (0.5 * (joints.px[16] + joints.px[18])).eval() : joints.px[head];
    add(middle, middle, 0.13, 0.13);
    if (joints.valid[0]) add(joints.px[0], middle, 0.07, 0.09);
  }
  for (const auto& [elbow, wrist] : {std::pair(4, 5), std::pair(10, 11)}) {
    if (!joints.valid[elbow] || !joints.valid[wrist]) continue;
    const Eigen::Vector2d along = joints.px[wrist] - joints.px[elbow];
    add(joints.px[wrist], joints.px[wrist] + along * (0.15 / 0.25), 0.045, 0.045);
  }
  for (const int ankle : {8, 14}) {
    if (joints.valid[ankle]) add(joints.px[ankle], joints.px[ankle] + Eigen::Vector2d(0, 0.06 * px_per_m), 0.10, 0.10);
  }
  for (const auto& [a, b] : internal::kBones) {
    if (joints.valid[a] && joints.valid[b]) body->bones.emplace_back(joints.px[a], joints.px[b]);
  }
  for (int j = 0; j < 19; ++j) {
    if (joints.valid[j]) body->joints_px.push_back(joints.px[j]);
  }
}

}  // namespace

ProjectedBody BodyFromKeypoints(const std::vector<Person2d>& people, const geometry::Skeleton& skeleton,
                                const MaskOptions& options) {
  const auto from = geometry::Coco19From(skeleton);
  ProjectedBody body;
  for (const Person2d& person : people) AddPerson(ToCoco19(person, from), options, &body);
  return body;
}

}  // namespace mvstudio::dataset
