#include "triangulate/point/diagnosis.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <set>

#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::triangulate {
namespace {

constexpr double kMinShiftPx = 2;
constexpr double kMinSigmas = 4;

/// Residuals of one camera.
struct Samples {
  std::vector<Eigen::Vector2d> residuals_px;           // observed minus projected
  std::vector<Eigen::Vector2d> left_out_residuals_px;  // against the point of the other cameras
  std::vector<Eigen::Vector2d> from_center_px;         // projection - principal point
  std::set<int> frames;
  int num_rejected = 0;
};

/// A view that carries its point pulls it: r = (I - J C J^T / s^2) r_left_out to first order.
Eigen::Vector2d LeftOut(const Eigen::Vector2d& residual, const Eigen::Matrix<double, 2, 3>& px_from_world, const Point& point,
                        double sigma_px) {
  const Eigen::Matrix2d leverage =
      px_from_world * (point.covariance - point.calibration_covariance) * px_from_world.transpose() / (sigma_px * sigma_px);
  const Eigen::Matrix2d rest = Eigen::Matrix2d::Identity() - leverage;
  // With two views the point follows them along the epipolar direction: nothing is left to extrapolate from.
  return rest.determinant() > 0.04 ? Eigen::Vector2d(rest.inverse() * residual) : residual;
}

void AddSamples(const PreparedRig& rig, const DiagnosedPoint& entry, size_t camera_idx, Samples* samples) {
  const Point& point = *entry.point;
  const PreparedCamera& camera = rig.cameras[camera_idx];
  for (size_t i = 0; i < entry.observations->size(); ++i) {
    const Observation& seen = (*entry.observations)[i];
    if (static_cast<size_t>(seen.camera_idx) != camera_idx || !seen.px.allFinite()) continue;
    const auto projection = camera.projector.ProjectWithJacobians(camera.ToCam(point.x_in_world - rig.origin_in_world));
    const bool used = std::binary_search(point.used.begin(), point.used.end(), static_cast<int>(i));
    samples->num_rejected += !used;
    if (projection.status != Status::kOk) continue;
    const Eigen::Vector2d residual = seen.px - projection.px;
    const Eigen::Matrix<double, 2, 3> px_from_world = projection.d_px_d_x * camera.cam_from_local_rotation;
    samples->residuals_px.push_back(residual);
    samples->left_out_residuals_px.push_back(used ? LeftOut(residual, px_from_world, point, seen.sigma_px) : residual);
    samples->from_center_px.push_back(projection.px - camera.projector.camera().params.segment<2>(2));
    samples->frames.insert(entry.frame);
  }
}

/// Mean of what lies within 5 robust sigmas of the median, and that sigma (from the median absolute deviation).
void RobustMean(const std::vector<Eigen::Vector2d>& values, Eigen::Vector2d* mean, Eigen::Vector2d* sigma) {
  for (int k = 0; k < 2; ++k) {
    std::vector<double> axis, deviations;
    for (const Eigen::Vector2d& value : values) axis.push_back(value[k]);
    const double median = UpperMedian(axis, 0);
    for (const double value : axis) deviations.push_back(std::abs(value - median));
    (*sigma)[k] = kSigmaPerMad * UpperMedian(deviations, 0);
    double sum = 0;
    int count = 0;
    for (const double value : axis) {
      if (std::abs(value - median) > 5 * (*sigma)[k]) continue;
      sum += value;
      ++count;
    }
    (*mean)[k] = count > 0 ? sum / count : 0;
  }
}

/// Slope of the residuals over the distance from the principal point, by Huber's weights.
void FitScale(const Samples& samples, int axis, double sigma, double* slope, double* slope_error) {
  const size_t n = samples.left_out_residuals_px.size();
  double offset = 0;
  *slope = *slope_error = 0;
  if (n < 10 || !(sigma > 0)) return;
  for (int round = 0; round < 10; ++round) {
    double w = 0, wx = 0, wy = 0, wxx = 0, wxy = 0;
    for (size_t i = 0; i < n; ++i) {
      const double x = samples.from_center_px[i][axis], y = samples.left_out_residuals_px[i][axis];
      const double weight = std::min(1.0, 1.345 * sigma / std::max(std::abs(y - offset - *slope * x), 1e-12));
      w += weight, wx += weight * x, wy += weight * y, wxx += weight * x * x, wxy += weight * x * y;
    }
    const double spread = wxx - wx * wx / w;
    if (!(spread > 1e-9)) return;
    *slope = (wxy - wx * wy / w) / spread;
    offset = (wy - *slope * wx) / w;
    *slope_error = sigma / std::sqrt(spread);
  }
}

std::string Message(const CameraDiagnosis& camera) {
  if (camera.off) {
    return Format("%s: detections are off by (%+.1f, %+.1f) px on average: its calibration or its image size is wrong",
                  camera.name.c_str(), camera.mean_residual_px.x(), camera.mean_residual_px.y());
  }
  return Format(
      "%s: detections are scaled by (%.4f, %.4f) about the principal point: its focal length or its image size is wrong",
      camera.name.c_str(), camera.image_scale.x(), camera.image_scale.y());
}

CameraDiagnosis Diagnose(const PreparedCamera& camera, const Samples& samples) {
  CameraDiagnosis result;
  result.name = camera.name;
  result.num_rejected = samples.num_rejected;
  result.num_detections = static_cast<int>(samples.residuals_px.size());
  if (samples.residuals_px.empty()) return result;
  RobustMean(samples.residuals_px, &result.mean_residual_px, &result.sigma_residual_px);
  Eigen::Vector2d left_out_sigma;
  RobustMean(samples.left_out_residuals_px, &result.mean_left_out_residual_px, &left_out_sigma);
  // The joints of one frame err together (a detector's habit, a blurred image): a frame is one sample.
  const double per_frame =
      std::sqrt(static_cast<double>(samples.residuals_px.size()) / static_cast<double>(samples.frames.size()));
  result.mean_error_px = result.sigma_residual_px / std::sqrt(static_cast<double>(samples.frames.size()));
  result.off = result.mean_residual_px.norm() > std::max(kMinShiftPx, kMinSigmas * result.mean_error_px.norm());
  const Eigen::Vector2d half_size(0.5 * camera.projector.camera().width_px, 0.5 * camera.projector.camera().height_px);
  for (int k = 0; k < 2; ++k) {
    double slope = 0, slope_error = 0;
    FitScale(samples, k, left_out_sigma[k], &slope, &slope_error);
    result.image_scale[k] = 1 + slope;
    result.image_scale_error[k] = slope_error * per_frame;
    if (std::abs(slope) * half_size[k] > kMinShiftPx && std::abs(slope) > kMinSigmas * result.image_scale_error[k])
      result.scaled = true;
  }
  if (result.off || result.scaled) result.message = Message(result);
  return result;
}

}  // namespace

std::vector<CameraDiagnosis> DiagnoseCameras(const PreparedRig& rig, const std::vector<DiagnosedPoint>& points) {
  std::vector<CameraDiagnosis> result;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {  // one after the other: the samples of all are large
    Samples samples;
    for (const DiagnosedPoint& entry : points) {
      if (entry.point->status == Status::kOk) AddSamples(rig, entry, c, &samples);
    }
    result.push_back(Diagnose(rig.cameras[c], samples));
  }
  return result;
}

}  // namespace mvstudio::triangulate
