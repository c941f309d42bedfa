#include "geometry/lens/lens_fit_starts.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>

#include "geometry/lens/lens_fit.h"
#include "geometry/lens/models.h"
#include "geometry/lens/models/spline_grid.h"

namespace mvstudio::geometry {
namespace {

Camera WithDistortion(const Camera& axis, LensModel to) {
  Camera camera = axis;
  camera.model = to;
  camera.params = Eigen::VectorXd::Zero(NumParams(to));
  camera.params.head<4>() = axis.params;
  for (int i = 0; i < TraitsOf(to).num_params; ++i) camera.params[4 + i] = TraitsOf(to).params[i].start;
  return camera;
}

/// Undistorted radius (tan theta, or theta) and distorted radius of every ray off the axis.
void RadiiOf(const Camera& axis, bool wide, const RayBundle& bundle, std::vector<double>* undistorted,
             std::vector<double>* distorted) {
  for (size_t i = 0; i < bundle.size(); ++i) {
    const Eigen::Vector3d& ray = bundle.rays[i];
    const double side = ray.head<2>().norm();
    const Eigen::Vector2d m = (bundle.px[i] - axis.params.tail<2>()).cwiseQuotient(axis.params.head<2>());
    undistorted->push_back(wide ? std::atan2(side, ray[2]) : side / ray[2]);
    distorted->push_back(m.norm());
  }
}

/// Solves r_d (1 + sum d_i r^2i) = r (1 + sum n_i r^2i) for the n numerator and d denominator coefficients, in least squares.
/// // (n + d)
Eigen::VectorXd SolveRadial(const std::vector<double>& r, const std::vector<double>& r_d, int n, int d) {
  Eigen::MatrixXd a(r.size(), n + d);
  Eigen::VectorXd b(r.size());
  for (size_t row = 0; row < r.size(); ++row) {
    double power = r[row] * r[row];
    for (int i = 0; i < std::max(n, d); ++i, power *= r[row] * r[row]) {
      if (i < n) a(row, i) = r[row] * power;
      if (i < d) a(row, n + i) = -r_d[row] * power;
    }
    b[row] = r_d[row] - r[row];
  }
  const Eigen::VectorXd scale = a.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = a * scale.cwiseInverse().asDiagonal();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled);
  qr.setThreshold(1e-12);
  return qr.solve(b).cwiseQuotient(scale);
}

std::vector<int> ParamsOfRole(LensModel model, LensRole role) {
  std::vector<int> found;
  for (int i = 0; i < TraitsOf(model).num_params; ++i) {
    if (TraitsOf(model).params[i].role == role) found.push_back(i);
  }
  return found;
}

/// The coefficients of a radial function r N(r^2) / D(r^2) by linear least squares; nothing for other radial functions.
std::optional<Camera> LinearFit(const Camera& axis, LensModel to, const RayBundle& bundle) {
  const std::vector<int> n = ParamsOfRole(to, LensRole::kNumerator), d = ParamsOfRole(to, LensRole::kDenominator);
  if (n.empty() && d.empty()) return std::nullopt;
  Camera camera = WithDistortion(axis, to);
  std::vector<double> r, r_d;
  RadiiOf(axis, IsWide(to), bundle, &r, &r_d);
  const Eigen::VectorXd k = SolveRadial(r, r_d, static_cast<int>(n.size()), static_cast<int>(d.size()));
  for (size_t i = 0; i < n.size() + d.size(); ++i) {
    camera.params[4 + (i < n.size() ? n[i] : d[i - n.size()])] = k[static_cast<Eigen::Index>(i)];
  }
  return camera;
}

/// `axis` with the first distortion parameters of model `to` set; the axis stays where it is.
Camera WithFirst(const Camera& axis, LensModel to, const std::vector<double>& first) {
  Camera camera = WithDistortion(axis, to);
  std::copy(first.begin(), first.end(), camera.params.data() + 4);
  const double scale = internal::VisitLens(to, {}, [&](auto lens) { return lens.AxisScale(camera.params.data() + 4); });
  camera.params.head<2>() *= scale;
  return camera;
}

/// Adds weight * (c[i - 1] - 2 c[i] + c[i + 1])^2 along rows and columns of the control grid to the normal matrix.
void AddBending(const SplineGrid& grid, double weight, Eigen::MatrixXd* normal) {
  const auto add = [&](int before, int at, int after) {
    const int place[3] = {before, at, after};
    const double factor[3] = {1, -2, 1};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) (*normal)(place[i], place[j]) += weight * factor[i] * factor[j];
    }
  };
  for (int row = 0; row < grid.rows; ++row) {
    for (int col = 0; col < grid.cols; ++col) {
      const int at = row * grid.cols + col;
      if (col > 0 && col + 1 < grid.cols) add(at - 1, at, at + 1);
      if (row > 0 && row + 1 < grid.rows) add(at - grid.cols, at, at + grid.cols);
    }
  }
}

}  // namespace

std::vector<Camera> LensFitStarts(const Camera& axis, LensModel to, const RayBundle& bundle) {
  const auto scan = internal::VisitLens(to, {}, [](auto lens) { return lens.FitStarts(); });
  std::vector<Camera> starts;
  for (const std::vector<double>& first : scan) starts.push_back(WithFirst(axis, to, first));
  if (!starts.empty()) return starts;
  starts.push_back(WithDistortion(axis, to));
  if (const auto linear = LinearFit(axis, to, bundle)) starts.push_back(*linear);
  return starts;
}

std::vector<Camera> BasinStarts(const Camera& from, LensModel to) {
  const auto basins = internal::VisitLens(to, {}, [](auto lens) { return lens.Basins(); });
  std::vector<Camera> starts;
  for (const std::vector<double>& first : basins) starts.push_back(WithFirst(PinholeOf(from), to, first));
  return starts;
}

Camera FitSpline(const Camera& axis, const SplineGrid& grid, const RayBundle& bundle) {
  Camera camera = axis;
  camera.model = LensModel::kSplined;
  camera.spline = grid;
  camera.params = Eigen::VectorXd::Zero(NumParams(camera));
  camera.params.head<4>() = axis.params;
  const int count = grid.cols * grid.rows;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(count, count);
  std::vector<SplineSample> samples;
  std::vector<Eigen::Vector2d> offsets;
  for (size_t i = 0; i < bundle.size(); ++i) {
    const Eigen::Vector3d& ray = bundle.rays[i];
    const Eigen::Vector2d u = 2 / (1 + ray[2]) * ray.head<2>();
    samples.push_back(SampleSpline(grid, camera.params.data() + 4, u));
    offsets.push_back((bundle.px[i] - axis.params.tail<2>()).cwiseQuotient(axis.params.head<2>()) - u);
  }
  const auto for_each = [&](const SplineSample& sample, const auto& visit) {
    for (int j = 0; j <= grid.order; ++j) {
      for (int i = 0; i <= grid.order; ++i) {
        visit((sample.row + j) * grid.cols + sample.col + i, sample.weights_y[j] * sample.weights_x[i]);
      }
    }
  };
  for (const SplineSample& sample : samples) {
    for_each(sample, [&](int a, double wa) { for_each(sample, [&](int b, double wb) { normal(a, b) += wa * wb; }); });
  }
  AddBending(grid, 1e-9 * normal.diagonal().maxCoeff(), &normal);
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  Eigen::MatrixX2d control = Eigen::MatrixX2d::Zero(count, 2);
  // The second and third rounds take away what rounding and the weight on bending left of the residual.
  for (int round = 0; round < 3; ++round) {
    Eigen::MatrixX2d right = Eigen::MatrixX2d::Zero(count, 2);
    for (size_t k = 0; k < samples.size(); ++k) {
      Eigen::RowVector2d residual = offsets[k].transpose();
      for_each(samples[k], [&](int a, double w) { residual -= w * control.row(a); });
      for_each(samples[k], [&](int a, double w) { right.row(a) += w * residual; });
    }
    control += solver.solve(right);
  }
  for (int i = 0; i < count; ++i) camera.params.segment<2>(4 + 2 * i) = control.row(i).transpose();
  return camera;
}

}  // namespace mvstudio::geometry
