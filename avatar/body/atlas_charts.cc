#include "avatar/body/atlas_charts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/charts/body_charts.h"
#include "core/units.h"

namespace mvstudio::body {
namespace {

double WrapNear(double angle, double center) { return center + std::remainder(angle - center, 2 * kPi); }

}  // namespace

double RegionAxis::Angle(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d w = (end - begin).normalized();
  const Eigen::Vector3d f = (front - w * w.dot(front)).normalized();
  const Eigen::Vector3d d = x - begin;
  return std::atan2(d.dot(w.cross(f)), d.dot(f));
}

double RegionAxis::Length(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d axis = end - begin, w = axis.normalized(), d = x - begin;
  const double along = d.dot(w), length = axis.norm(), radius = (d - w * along).norm();
  if (along < 0) return -arc_m * std::atan2(-along, radius);
  if (along > length) return length + arc_m * std::atan2(along - length, radius);
  return along;
}

Eigen::Matrix3d FaceCorners(const BodyTemplate& body, int f) {
  Eigen::Matrix3d corners;
  for (int k = 0; k < 3; ++k) corners.col(k) = body.vertices.col(body.faces(k, f)).cast<double>();
  return corners;
}

void ChartFace(const RegionAxis& axis, int f, BodyTemplate* body) {
  const Eigen::Matrix3d corners = FaceCorners(*body, f);
  const bool one_chart = axis.front_part == axis.back_part;
  const double at = axis.Angle(corners.rowwise().mean());
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

}  // namespace mvstudio::body
