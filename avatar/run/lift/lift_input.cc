#include "avatar/run/lift/lift_input.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace mvstudio::avatar {
namespace {

constexpr double kMinDepth = 0.05;   // of a unit direction along the view's axis
constexpr double kMinSpread = 1e-6;  // radians

bool IsFinite(const LiftView& view) {
  for (int j = 0; j < kLiftJoints; ++j) {
    if (!std::isfinite(view.score[j]) || (view.score[j] > 0 && !view.ray_in_cam.col(j).allFinite())) return false;
  }
  return true;
}

int CountSeen(const LiftView& view) {
  return static_cast<int>(std::count_if(view.score.begin(), view.score.end(), [](double s) { return s > 0; }));
}

/// Columns: the view's axes. x is level, y points down as far as it can, z looks along `axis`.
Eigen::Matrix3d ViewAxes(const Eigen::Vector3d& axis, const Eigen::Vector3d& down) {
  Eigen::Matrix3d m;
  m.col(2) = axis;
  Eigen::Vector3d x = down.cross(axis);
  if (x.norm() < 1e-6 * down.norm()) x = Eigen::Vector3d::UnitY().cross(axis);  // looks straight down
  if (x.norm() < 1e-6) x = Eigen::Vector3d::UnitX();
  m.col(0) = x.normalized();
  m.col(1) = m.col(2).cross(m.col(0));
  return m;
}

struct Plane {
  std::array<Eigen::Matrix<double, 2, kLiftJoints>, kLiftWindow> xy;
  std::array<std::array<double, kLiftJoints>, kLiftWindow> score{};
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double spread = 0;
};

Plane ToPlane(const std::array<LiftView, kLiftWindow>& window, const Eigen::Matrix3d& view_from_cam) {
  Plane plane;
  int count = 0;
  const auto for_seen = [&](const auto& body) {
    for (int f = 0; f < kLiftWindow; ++f) {
      for (int j = 0; j < kLiftJoints; ++j) {
        if (plane.score[f][j] > 0) body(plane.xy[f].col(j));
      }
    }
  };
  for (int f = 0; f < kLiftWindow; ++f) {
    plane.xy[f].setZero();
    if (!IsFinite(window[f])) continue;
    for (int j = 0; j < kLiftJoints; ++j) {
      const Eigen::Vector3d ray = view_from_cam * window[f].ray_in_cam.col(j);
      if (!(window[f].score[j] > 0) || ray.z() < kMinDepth * ray.norm()) continue;
      plane.xy[f].col(j) = ray.head<2>() / ray.z();
      plane.score[f][j] = std::min(1.0, window[f].score[j]);
    }
  }
  for_seen([&](const auto& xy) { plane.centre += xy, ++count; });
  if (count == 0) return plane;
  plane.centre /= count;
  for_seen([&](const auto& xy) { plane.spread += (xy - plane.centre).squaredNorm(); });
  plane.spread = std::sqrt(plane.spread / count);
  return plane;
}

Eigen::Vector3d MeanDirection(const LiftView& view) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int j = 0; j < kLiftJoints; ++j) {
    if (view.score[j] > 0) sum += view.ray_in_cam.col(j).normalized();
  }
  return sum;
}

LiftInput Refused(Status status) {
  LiftInput input;
  input.status = status;
  return input;
}

}  // namespace

LiftView ViewOf(const geometry::Projector& projector, const dataset::Person2d& person, const geometry::Skeleton& skeleton) {
  LiftView view;
  const auto sources = geometry::Coco19From(skeleton);
  for (int j = 0; j < kLiftJoints; ++j) {
    if (sources[j].empty()) continue;
    Eigen::Vector2d px = Eigen::Vector2d::Zero();
    double score = 1;
    for (const int s : sources[j]) {
      const dataset::Keypoint2d& k = person.keypoints[static_cast<size_t>(s)];
      px += Eigen::Vector2d(k.x_px, k.y_px) / static_cast<double>(sources[j].size());
      score = std::isnan(k.score) ? k.score : std::min(score, k.score);
    }
    if (score <= 0) continue;
    view.score[j] = score;
    view.ray_in_cam.col(j).setConstant(std::nan(""));
    if (!px.allFinite() || std::isnan(score)) continue;
    const geometry::Unprojection ray = projector.Unproject(px);
    if (ray.status != Status::kOk) view.score[j] = 0;
    view.ray_in_cam.col(j) = ray.ray_in_cam;
  }
  return view;
}

LiftInput MakeLiftInput(const std::array<LiftView, kLiftWindow>& window, const std::optional<Eigen::Vector3d>& up_in_cam) {
  const LiftView& middle = window[kLiftWindow / 2];
  if (!IsFinite(middle) || (up_in_cam && !up_in_cam->allFinite())) return Refused(Status::kNonFiniteInput);
  if (CountSeen(middle) < kMinLiftJoints) return Refused(Status::kTooFewViews);
  const Eigen::Vector3d direction = MeanDirection(middle);
  if (direction.norm() < 1e-9) return Refused(Status::kBehindCamera);
  const bool level = up_in_cam && up_in_cam->norm() > 0;
  const Eigen::Vector3d down = level ? Eigen::Vector3d(-up_in_cam->normalized()) : Eigen::Vector3d(Eigen::Vector3d::UnitY());
  LiftInput input;
  input.cam_from_view = ViewAxes(direction.normalized(), down);
  const Plane plane = ToPlane(window, input.cam_from_view.transpose());
  input.xy_in_view = plane.xy[kLiftWindow / 2], input.score = plane.score[kLiftWindow / 2];
  if (std::count_if(input.score.begin(), input.score.end(), [](double s) { return s > 0; }) < kMinLiftJoints) {
    return Refused(Status::kBehindCamera);
  }
  if (!(plane.spread > kMinSpread)) return Refused(Status::kDegenerate);
  for (int f = 0; f < kLiftWindow; ++f) {
    for (int j = 0; j < kLiftJoints; ++j) {
      const bool seen = plane.score[f][j] > 0;
      for (int k = 0; k < 2; ++k) {
        input.values.push_back(seen ? static_cast<float>((plane.xy[f](k, j) - plane.centre[k]) / plane.spread) : 0.0f);
      }
      input.values.push_back(static_cast<float>(plane.score[f][j]));
    }
  }
  input.values.push_back(static_cast<float>(std::log(plane.spread / 0.2)));
  input.values.push_back(level ? static_cast<float>(down.dot(input.cam_from_view.col(2))) : 0.0f);
  input.values.push_back(level ? 1.0f : 0.0f);
  return input;
}

LiftPlacement PlaceInView(const Eigen::Matrix<double, 3, kLiftJoints>& x, const Eigen::Matrix<double, 2, kLiftJoints>& xy,
                          const std::array<double, kLiftJoints>& score) {
  LiftPlacement place;
  double sum = 0;
  Eigen::Vector2d mean_xy = Eigen::Vector2d::Zero(), mean_b = Eigen::Vector2d::Zero();
  int count = 0;
  const auto right_side = [&](int j) -> Eigen::Vector2d { return x(2, j) * xy.col(j) - x.col(j).head<2>(); };
  for (int j = 0; j < kLiftJoints; ++j) {
    if (!(score[j] > 0)) continue;
    if (!x.col(j).allFinite() || !xy.col(j).allFinite()) return {Status::kNonFiniteInput};
    sum += score[j], mean_xy += score[j] * xy.col(j), mean_b += score[j] * right_side(j), ++count;
  }
  if (count < kMinLiftJoints) return {Status::kTooFewViews};
  mean_xy /= sum, mean_b /= sum;
  double product = 0, square = 0;
  for (int j = 0; j < kLiftJoints; ++j) {
    if (!(score[j] > 0)) continue;
    const Eigen::Vector2d d = xy.col(j) - mean_xy;
    product += score[j] * d.dot(right_side(j) - mean_b), square += score[j] * d.squaredNorm();
  }
  if (!(square > kMinSpread * kMinSpread * sum)) return {Status::kDegenerate};
  const double depth = -product / square;
  place.root_in_view << mean_b + depth * mean_xy, depth;
  double residual = 0;
  for (int j = 0; j < kLiftJoints; ++j) {
    if (!(score[j] > 0)) continue;
    const Eigen::Vector3d at = x.col(j) + place.root_in_view;
    if (!(at.z() > 0)) return {Status::kBehindCamera};
    residual += score[j] * (at.head<2>() / at.z() - xy.col(j)).squaredNorm();
  }
  place.rms = std::sqrt(residual / sum);
  return place;
}

}  // namespace mvstudio::avatar
