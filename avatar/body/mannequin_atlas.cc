#include "avatar/body/mannequin_atlas.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "avatar/body/atlas_charts.h"

namespace mvstudio::body {
namespace {

Eigen::Vector3d Mirror(const Eigen::Vector3d& x) { return {-x[0], x[1], x[2]}; }

std::array<RegionAxis, kNumRegions> RegionAxes() {
  const MannequinJoints j;
  const Eigen::Vector3d front(0, -1, 0), left(1, 0, 0), out(1, 0, 1);
  auto inset = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b, double m) {
    return Eigen::Vector3d(b + m * (a - b).normalized());
  };
  std::array<RegionAxis, kNumRegions> axes;
  axes[kTorso] = {{0, 0, 0.90}, {0, 0.006, 1.35}, front, 2, 1, 0.13};
  axes[kHead] = {{0, 0.006, 1.46}, {0, 0.006, 1.655}, left, 24, 23, 0.085};
  axes[kUpperArmL] = {j.shoulder, j.elbow, out, 17, 15, 0.05};
  axes[kForearmL] = {j.elbow, j.wrist, out, 21, 19, 0.04};
  axes[kHandL] = {j.wrist, inset(j.wrist, j.hand_tip, 0.025), out, 4, 4, 0.025};
  axes[kThighL] = {j.hip, j.knee, front, 10, 8, 0.07};
  axes[kShinL] = {j.knee, j.ankle, front, 14, 12, 0.06};
  axes[kFootL] = {{j.ankle[0], j.ankle[1] + 0.02, 0.045}, inset(j.ankle, j.toe_tip, 0.03), {0, 0, 1}, 5, 5, 0.04};
  const int right_parts[][2] = {{18, 16}, {22, 20}, {3, 3}, {9, 7}, {13, 11}, {6, 6}};
  const Region lefts[] = {kUpperArmL, kForearmL, kHandL, kThighL, kShinL, kFootL};
  const Region rights[] = {kUpperArmR, kForearmR, kHandR, kThighR, kShinR, kFootR};
  for (int i = 0; i < 6; ++i) {
    const RegionAxis& l = axes[lefts[i]];
    axes[rights[i]] = {Mirror(l.begin), Mirror(l.end), Mirror(l.front), right_parts[i][0], right_parts[i][1], l.arc_m};
  }
  return axes;
}

int NearestRegion(const std::vector<Tube>& tubes, const Eigen::Vector3d& x) {
  std::array<double, kNumRegions> value;
  value.fill(1e9);
  for (const Tube& tube : tubes) value[tube.region] = std::min(value[tube.region], tube.Value(x));
  return static_cast<int>(std::min_element(value.begin(), value.end()) - value.begin());
}

double SmoothStep(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

bool Adjacent(int a, int b) {
  static constexpr int kParent[kNumRegions] = {-1,        kTorso, kTorso,  kUpperArmL, kForearmL, kTorso,  kUpperArmR,
                                               kForearmR, kTorso, kThighL, kShinL,     kTorso,    kThighR, kShinR};
  return a == b || kParent[a] == b || kParent[b] == a;
}

using Weights = Eigen::Matrix<double, kNumMannequinBones, 1>;

/// Splits a region's weight over the bones inside the region.
void SpreadRegion(int region, double weight, const Eigen::Vector3d& x, Weights* w) {
  static constexpr MannequinBone kBone[kNumRegions] = {kChest,         kHeadBone,     kUpperArmBoneL, kForearmBoneL, kHandBoneL,
                                                       kUpperArmBoneR, kForearmBoneR, kHandBoneR,     kThighBoneL,   kShinBoneL,
                                                       kFootBoneL,     kThighBoneR,   kShinBoneR,     kFootBoneR};
  if (region == kHead) {
    const double head = SmoothStep(1.47, 1.57, x[2] + 0.25 * std::max(0.0, -x[1] - 0.03));
    (*w)[kHeadBone] += weight * head;
    (*w)[kNeck] += weight * (1 - head);
  } else if (region == kTorso) {
    const double spine = SmoothStep(0.95, 1.11, x[2]), chest = SmoothStep(1.12, 1.30, x[2]);
    const double clavicle = SmoothStep(0.05, 0.17, std::abs(x[0])) * SmoothStep(1.27, 1.40, x[2]);
    const double neck = SmoothStep(1.44, 1.50, x[2]) * (1 - clavicle);
    (*w)[kPelvis] += weight * (1 - spine);
    (*w)[kSpine] += weight * (spine - chest);
    (*w)[x[0] > 0 ? kClavicleL : kClavicleR] += weight * chest * clavicle;
    (*w)[kNeck] += weight * chest * neck;
    (*w)[kChest] += weight * chest * (1 - clavicle - neck);
  } else {
    (*w)[kBone[region]] += weight;
  }
}

Weights RawWeights(const std::vector<Tube>& tubes, const Eigen::Vector3d& x) {
  constexpr double kSoftness = 0.016;  // m, half width of the blend at a joint
  const int nearest = NearestRegion(tubes, x);
  const double base = ShapeValue(tubes, nearest, x);
  Weights w = Weights::Zero();
  for (int region = 0; region < kNumRegions; ++region) {
    if (!Adjacent(nearest, region)) continue;
    SpreadRegion(region, std::exp(-std::max(0.0, ShapeValue(tubes, region, x) - base) / kSoftness), x, &w);
  }
  return w / w.sum();
}

/// Averages over mesh neighbours, `rounds` times.
void SmoothWeights(const Eigen::Matrix3Xi& faces, int rounds, Eigen::MatrixXd* weights) {
  for (int round = 0; round < rounds; ++round) {
    Eigen::MatrixXd sum = *weights;
    Eigen::VectorXd count = Eigen::VectorXd::Ones(weights->cols());
    for (int f = 0; f < faces.cols(); ++f) {
      for (int k = 0; k < 3; ++k) {
        const int a = faces(k, f), b = faces((k + 1) % 3, f);
        sum.col(a) += weights->col(b);
        count[a] += 1;
      }
    }
    *weights = sum * count.cwiseInverse().asDiagonal();
  }
}

}  // namespace

void BuildAtlas(const std::vector<Tube>& tubes, BodyTemplate* body) {
  const std::array<RegionAxis, kNumRegions> axes = RegionAxes();
  const int num_faces = static_cast<int>(body->faces.cols());
  body->face_part.resize(num_faces);
  body->face_uv.resize(2, 3 * num_faces);
  for (int f = 0; f < num_faces; ++f) {
    ChartFace(axes[NearestRegion(tubes, FaceCorners(*body, f).rowwise().mean())], f, body);
  }
  NormalizeCharts(body);
}

void BuildSkinWeights(const std::vector<Tube>& tubes, BodyTemplate* body) {
  const int num_vertices = static_cast<int>(body->vertices.cols());
  Eigen::MatrixXd weights(kNumMannequinBones, num_vertices);
  for (int i = 0; i < num_vertices; ++i) weights.col(i) = RawWeights(tubes, body->vertices.col(i).cast<double>());
  SmoothWeights(body->faces, 4, &weights);
  body->skin_bones.resize(4, num_vertices);
  body->skin_weights.resize(4, num_vertices);
  for (int i = 0; i < num_vertices; ++i) {
    std::array<int, kNumMannequinBones> order;
    for (int b = 0; b < kNumMannequinBones; ++b) order[b] = b;
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return weights(a, i) > weights(b, i); });
    double sum = 0;
    for (int k = 0; k < 4; ++k) sum += weights(order[k], i);
    for (int k = 0; k < 4; ++k) {
      body->skin_bones(k, i) = order[k];
      body->skin_weights(k, i) = static_cast<float>(weights(order[k], i) / sum);
    }
  }
}

}  // namespace mvstudio::body
