#include "body/mannequin_atlas.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/body_charts.h"
#include "core/units.h"

namespace mvstudio::body {
namespace {

/// Cylindrical chart coordinates of a region: `angle` around the axis from `front`, `length` along it, going over the ends as
/// an arc.
struct RegionAxis {
  Eigen::Vector3d begin, end, front;
  int front_part, back_part;  // the same when the region is one chart
  double arc_m;               // radius that turns angles at the ends into lengths

  double Angle(const Eigen::Vector3d& x) const {
    const Eigen::Vector3d w = (end - begin).normalized();
    const Eigen::Vector3d f = (front - w * w.dot(front)).normalized();
    const Eigen::Vector3d d = x - begin;
    return std::atan2(d.dot(w.cross(f)), d.dot(f));
  }
  double Length(const Eigen::Vector3d& x) const {
    const Eigen::Vector3d axis = end - begin, w = axis.normalized(), d = x - begin;
    const double along = d.dot(w), length = axis.norm(), radius = (d - w * along).norm();
    if (along < 0) return -arc_m * std::atan2(-along, radius);
    if (along > length) return length + arc_m * std::atan2(along - length, radius);
    return along;
  }
};

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

double WrapNear(double angle, double center) { return center + std::remainder(angle - center, 2 * kPi); }

int NearestRegion(const std::vector<Tube>& tubes, const Eigen::Vector3d& x) {
  std::array<double, kNumRegions> value;
  value.fill(1e9);
  for (const Tube& tube : tubes) value[tube.region] = std::min(value[tube.region], tube.Value(x));
  return static_cast<int>(std::min_element(value.begin(), value.end()) - value.begin());
}

/// Scales every chart into [0, 1] x [0, 1]. Charts alike share their range of v, so that patterns go on across their seams.
void NormalizeCharts(BodyTemplate* body) {
  Eigen::Matrix2Xf low = Eigen::Matrix2Xf::Constant(2, kNumParts + 1, 1e9f), high = -low;
  for (int f = 0; f < body->faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int part = body->face_part[f];
      low.col(part) = low.col(part).cwiseMin(body->face_uv.col(3 * f + k));
      high.col(part) = high.col(part).cwiseMax(body->face_uv.col(3 * f + k));
    }
  }
  for (const auto& twins : kAlikeCharts) {
    float v_low = 1e9f, v_high = -1e9f;
    for (int part : twins) v_low = std::min(v_low, low(1, part)), v_high = std::max(v_high, high(1, part));
    for (int part : twins) low(1, part) = v_low, high(1, part) = v_high;
  }
  for (int i = 0; i < body->face_uv.cols(); ++i) {
    const int part = body->face_part[i / 3];
    body->face_uv.col(i) =
        ((body->face_uv.col(i) - low.col(part)).array() / (high.col(part) - low.col(part)).array()).cwiseMax(0.f).cwiseMin(1.f);
  }
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
    Eigen::Matrix3d corners;
    for (int k = 0; k < 3; ++k) corners.col(k) = body->vertices.col(body->faces(k, f)).cast<double>();
    const Eigen::Vector3d center = corners.rowwise().mean();
    const RegionAxis& axis = axes[NearestRegion(tubes, center)];
    const bool one_chart = axis.front_part == axis.back_part;
    const double at = axis.Angle(center);
    const bool front = one_chart || std::abs(at) <= kPi / 2;
    const double chart_angle = front ? 0 : kPi, center_angle = WrapNear(at, chart_angle);
    const double reach = (one_chart ? kPi : kPi / 2) + std::min(0.5, 0.014 / axis.arc_m);  // with room for a ragged seam
    body->face_part[f] = front ? axis.front_part : axis.back_part;
    for (int k = 0; k < 3; ++k) {
      const double angle = WrapNear(axis.Angle(corners.col(k)), center_angle) - chart_angle;
      body->face_uv.col(3 * f + k) =
          Eigen::Vector2d(std::clamp(angle / reach, -1.0, 1.0), axis.Length(corners.col(k))).cast<float>();
    }
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
