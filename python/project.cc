#include "python/project.h"

#include <pybind11/eigen.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "dataset/views/undistort.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::python {
namespace {

using RowMajor23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using RowMajorX = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Where a camera has the points: as they are given, or moved from world.
struct Mover {
  Mover(const HeldRig& held, size_t camera, bool in_cam)
      : rotation(in_cam ? Eigen::Matrix3d::Identity()
                        : Eigen::Matrix3d(held.rig.cameras[camera].cam_from_world.rotation.toRotationMatrix())),
        translation(in_cam ? Eigen::Vector3d::Zero() : held.rig.cameras[camera].cam_from_world.translation),
        moves(!in_cam) {}
  Eigen::Vector3d operator()(const double* x) const {
    const Eigen::Map<const Eigen::Vector3d> point(x);
    return moves ? Eigen::Vector3d(rotation * point + translation) : Eigen::Vector3d(point);
  }
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  bool moves;
};

}  // namespace

py::array_t<double> Project(const HeldRig& held, const Doubles& points, const py::object& camera, bool in_cam, int threads) {
  const Shape leading = LeadingShape(points, 3, "points");
  const size_t c = held.Camera(camera);
  py::array_t<double> result(With(leading, {2}));
  const double* from = points.data();
  double* to = result.mutable_data();
  const Mover moved(held, c, in_cam);
  const geometry::Projector& projector = held.projectors[c];
  ForPieces(NumIn(leading), threads, [&](py::ssize_t begin, py::ssize_t end) {
    for (py::ssize_t i = begin; i < end; ++i) {
      const geometry::Projection seen = projector.Project(moved(from + 3 * i));
      const bool ok = seen.status == Status::kOk;
      to[2 * i] = ok ? seen.px.x() : kNan, to[2 * i + 1] = ok ? seen.px.y() : kNan;
    }
  });
  return result;
}

py::tuple ProjectWithJacobians(const HeldRig& held, const Doubles& points, const py::object& camera, bool in_cam, int threads) {
  const Shape leading = LeadingShape(points, 3, "points");
  const size_t c = held.Camera(camera);
  const Eigen::Index num_params = held.rig.cameras[c].camera.params.size();
  py::array_t<double> px(With(leading, {2})), by_point(With(leading, {2, 3})), by_params(With(leading, {2, num_params}));
  const double* from = points.data();
  double *to = px.mutable_data(), *d_x = by_point.mutable_data(), *d_params = by_params.mutable_data();
  const Mover moved(held, c, in_cam);
  const geometry::Projector& projector = held.projectors[c];
  ForPieces(NumIn(leading), threads, [&](py::ssize_t begin, py::ssize_t end) {
    for (py::ssize_t i = begin; i < end; ++i) {
      const geometry::ProjectionWithJacobians seen = projector.ProjectWithJacobians(moved(from + 3 * i));
      const bool ok = seen.status == Status::kOk;
      Eigen::Map<Eigen::Vector2d> point(to + 2 * i);
      Eigen::Map<RowMajor23> by_x(d_x + 6 * i);
      Eigen::Map<RowMajorX> by_lens(d_params + 2 * num_params * i, 2, num_params);
      point.setConstant(kNan), by_x.setConstant(kNan), by_lens.setConstant(kNan);
      if (ok) point = seen.px, by_x = seen.d_px_d_x * moved.rotation, by_lens = seen.d_px_d_params;
    }
  });
  return py::make_tuple(px, by_point, by_params);
}

py::array_t<double> Unproject(const HeldRig& held, const Doubles& px, const py::object& camera, bool in_world, int threads) {
  const Shape leading = LeadingShape(px, 2, "px");
  const size_t c = held.Camera(camera);
  py::array_t<double> result(With(leading, {3}));
  const double* from = px.data();
  double* to = result.mutable_data();
  const Eigen::Matrix3d frame_from_cam = Mover(held, c, !in_world).rotation.transpose();
  const geometry::Projector& projector = held.projectors[c];
  ForPieces(NumIn(leading), threads, [&](py::ssize_t begin, py::ssize_t end) {
    for (py::ssize_t i = begin; i < end; ++i) {
      const Eigen::Vector2d at(from[2 * i], from[2 * i + 1]);
      Eigen::Map<Eigen::Vector3d> ray(to + 3 * i);
      ray.setConstant(kNan);
      if (!at.allFinite()) continue;
      const geometry::Unprojection back = projector.Unproject(at);
      if (back.status == Status::kOk) ray = in_world ? Eigen::Vector3d(frame_from_cam * back.ray_in_cam) : back.ray_in_cam;
    }
  });
  return result;
}

py::array_t<double> UncertaintyPx(const HeldRig& held, const Doubles& px, const py::object& camera, double range_m,
                                  int threads) {
  const Shape leading = LeadingShape(px, 2, "px");
  const size_t c = held.Camera(camera);
  const geometry::StatedCovariance stated = geometry::StatedCovarianceOf(held.rig);
  if (!stated.Knows(c))
    throw UsageError("the calibration states no covariance of camera '" + held.rig.cameras[c].camera.name +
                     "', lens and pose; those that mvstudio calibrates have one");
  if (!(range_m > 0) || !std::isfinite(range_m)) throw UsageError("option 'range-m': expected a distance above 0, in metres");
  const Eigen::Index first = stated.begin[c], rows = stated.begin[c + 1] - first;
  const Eigen::MatrixXd covariance = stated.joint.block(first, first, rows, rows);
  const Eigen::Vector3d translation = held.rig.cameras[c].cam_from_world.translation;
  py::array_t<double> result(leading);
  const double* from = px.data();
  double* to = result.mutable_data();
  const geometry::Projector& projector = held.projectors[c];
  ForPieces(NumIn(leading), threads, [&](py::ssize_t begin, py::ssize_t end) {
    Eigen::Matrix<double, 2, Eigen::Dynamic> jacobian(2, rows);
    for (py::ssize_t i = begin; i < end; ++i) {
      to[i] = kNan;
      const Eigen::Vector2d at(from[2 * i], from[2 * i + 1]);
      if (!at.allFinite()) continue;
      const geometry::Unprojection ray = projector.Unproject(at);
      if (ray.status != Status::kOk) continue;
      const Eigen::Vector3d x_in_cam = range_m * ray.ray_in_cam;
      const geometry::ProjectionWithJacobians seen = projector.ProjectWithJacobians(x_in_cam);
      if (seen.status != Status::kOk) continue;
      jacobian << seen.d_px_d_params, -seen.d_px_d_x * geometry::CrossMatrix(x_in_cam - translation), seen.d_px_d_x;
      const Eigen::Matrix2d at_px = jacobian * covariance * jacobian.transpose();
      to[i] = std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(at_px).eigenvalues()[1]));
    }
  });
  return result;
}

py::tuple UndistortionMap(const HeldRig& held, const py::object& camera, const std::string& view, int width_px, int height_px,
                          double max_fov_deg, int threads) {
  const geometry::RigCamera& source = held.rig.cameras[held.Camera(camera)];
  dataset::UndistortOptions options;
  SetFromString(view, "view", &options.view);
  options.width_px = width_px, options.height_px = height_px, options.max_fov_deg = max_fov_deg;
  const dataset::UndistortedCamera pinhole = dataset::IdealPinhole(source, options);
  if (!pinhole.usable()) throw UsageError("camera '" + source.camera.name + "' has no such pinhole: " + pinhole.reason);
  const geometry::Camera& ideal = pinhole.camera.camera;
  const int width = ideal.width_px, height = ideal.height_px;
  py::array_t<double> map({static_cast<py::ssize_t>(height), static_cast<py::ssize_t>(width), py::ssize_t{2}});
  double* to = map.mutable_data();
  const geometry::Projector from(source.camera), pixels(ideal);
  ForPieces(static_cast<py::ssize_t>(width) * height, threads, [&](py::ssize_t begin, py::ssize_t end) {
    for (py::ssize_t i = begin; i < end; ++i) {
      to[2 * i] = to[2 * i + 1] = kNan;
      const geometry::Unprojection ray = pixels.Unproject(Eigen::Vector2d(i % width, i / width));
      if (ray.status != Status::kOk) continue;
      const geometry::Projection seen = from.Project(ray.ray_in_cam);
      if (seen.status == Status::kOk) to[2 * i] = seen.px.x(), to[2 * i + 1] = seen.px.y();
    }
  });
  return py::make_tuple(map, ideal.K());
}

}  // namespace mvstudio::python
