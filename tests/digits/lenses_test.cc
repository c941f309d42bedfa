#include <cmath>
#include <limits>

#include "core/format.h"
#include "core/random.h"
#include "core/units.h"
#include "geometry/rigid/rigid3.h"
#include "tests/geometry/exact_lens.h"
#include "tests/support/digits.h"
#include "tests/support/test.h"

/// Digits of every lens, both ways, and of rotations.
namespace mvstudio::geometry {
namespace {

using testing::Vector3mp;

constexpr int kDirections = 24;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const char* const kMpfr = "MPFR, 120 digits";

DigitsCase Case(const std::string& what, const std::string& conditions, const std::string& oracle = kMpfr) {
  return {"Lenses", what, conditions, oracle};
}

std::string NameOf(const Camera& camera) {
  return camera.model == LensModel::kSplined ? Format("splined, order %d", camera.spline.order)
                                             : std::string(ToString(camera.model));
}

std::vector<Camera> WithFocal(double focal) {
  std::vector<Camera> lenses = testing::OrdinaryLenses();
  for (Camera& camera : lenses) camera.params.head<2>() << focal, 1.002 * focal;
  return lenses;
}

/// Directions inside what the lens can see, from the axis outwards.
Eigen::Vector3d DirectionOf(const Camera& camera, int i) {
  return testing::Direction(camera.model, testing::Reach(camera) * (i + 0.5) / kDirections, 2.39996 * i).normalized();
}

/// Distance from the exact pixel as a share of the largest coordinate that takes part.
double ProjectionError(const Camera& camera, const Eigen::Vector3d& x, double factor) {
  const Projection found = Projector(camera).Project(factor * x);
  if (found.status != Status::kOk) return std::nan("");
  const Vector2mp exact = testing::ProjectExactly(camera, Vector3mp((factor * x).cast<Mp>()));
  const double size = std::max(found.px.lpNorm<Eigen::Infinity>(), camera.params.segment<2>(2).lpNorm<Eigen::Infinity>());
  return static_cast<double>((found.px.cast<Mp>() - exact).norm()) / size;
}

/// Angle from the exact ray of the pixel, radians.
double RayError(const Camera& camera, const Eigen::Vector3d& x) {
  const Projection there = Projector(camera).Project(x);
  const Unprojection back = Projector(camera).Unproject(there.px);
  if (there.status != Status::kOk || back.status != Status::kOk) return std::nan("");
  const testing::ExactRay exact = testing::UnprojectExactly(camera, there.px, x);
  if (!exact.found) return std::nan("");
  return static_cast<double>((exact.ray - back.ray_in_cam.cast<Mp>()).norm());
}

/// There and back: distance of the pixels as a share of their size.
double RoundTripError(const Camera& camera, const Eigen::Vector3d& x) {
  const Projector projector(camera);
  const Projection there = projector.Project(x);
  const Unprojection back = projector.Unproject(there.px);
  if (there.status != Status::kOk || back.status != Status::kOk) return std::nan("");
  const Projection again = projector.Project(back.ray_in_cam);
  return (again.px - there.px).norm() / std::max(there.px.norm(), camera.params.segment<2>(2).norm());
}

template <class Error>
double WorstOf(const std::vector<Camera>& lenses, const Error& error) {
  WorstError worst;
  for (const Camera& camera : lenses) {
    for (int i = 0; i < kDirections; ++i) worst.Add(error(camera, DirectionOf(camera, i)));
  }
  return worst.value();
}

TEST(LensDigits, EveryModel) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const std::string name = NameOf(camera), where = Format("%d directions to its reach", kDirections);
    const auto project = [](const Camera& c, const Eigen::Vector3d& x) { return ProjectionError(c, x, 1); };
    RecordDigits(Case("pixel of a point, `" + name + "`", where), 14, WorstOf({camera}, project));
    RecordDigits(Case("ray of a pixel, `" + name + "`", where), 11, WorstOf({camera}, RayError));
    RecordDigits(Case("pixel to ray to pixel, `" + name + "`", where, "itself"), 11, WorstOf({camera}, RoundTripError));
  }
}

TEST(LensDigits, FocalLengths) {
  for (const double focal : {1e-3, 1.0, 1e3, 1e6, 1e9}) {
    const std::string conditions = Format("f = %g px, worst of all models", focal);
    const auto project = [](const Camera& c, const Eigen::Vector3d& x) { return ProjectionError(c, x, 1); };
    RecordDigits(Case("pixel of a point", conditions), 14, WorstOf(WithFocal(focal), project));
    // The promise is a residual of 1e-9 px, and a ray's angle is that over the focal length.
    const int promised = focal < 1 ? 5 : focal < 1e3 ? 8 : 11;
    RecordDigits(Case("ray of a pixel", conditions), promised, WorstOf(WithFocal(focal), RayError));
  }
}

TEST(LensDigits, DistancesOfPoints) {
  for (const double factor : {1e-300, 1e-150, 1e-9, 1e9, 1e150, 1e300}) {
    const auto project = [factor](const Camera& c, const Eigen::Vector3d& x) { return ProjectionError(c, x, factor); };
    RecordDigits(Case("pixel of a point", Format("%g m away, worst of all models", factor)), 14,
                 WorstOf(testing::OrdinaryLenses(), project));
  }
}

/// The status of all lenses, or "differs".
template <class Call>
std::string CommonStatus(bool wide_too, const Call& call) {
  std::string common;
  for (const Camera& camera : testing::OrdinaryLenses()) {
    if (IsWide(camera.model) && !wide_too) continue;
    const std::string status(ToString(call(Projector(camera))));
    if (!common.empty() && status != common) return "differs";
    common = status;
  }
  return common;
}

TEST(LensDigits, WhatHasNoPixel) {
  const auto point = [](const Eigen::Vector3d& x) { return [x](const Projector& p) { return p.Project(x).status; }; };
  const auto pixel = [](const Eigen::Vector2d& px) { return [px](const Projector& p) { return p.Unproject(px).status; }; };
  const double none = std::nan(""), least = std::numeric_limits<double>::denorm_min();
  const char* const definition = "definition";
  RecordStatus(Case("point with a NaN", "all models", definition), "NonFiniteInput", CommonStatus(true, point({0.1, none, 1})));
  RecordStatus(Case("point at infinity", "all models", definition), "NonFiniteInput",
               CommonStatus(true, point({0.1, 0, kInfinity})));
  RecordStatus(Case("pixel with a NaN", "all models", definition), "NonFiniteInput", CommonStatus(true, pixel({none, 1})));
  RecordStatus(Case("pixel at infinity", "all models", definition), "NonFiniteInput",
               CommonStatus(true, pixel({1, kInfinity})));
  RecordStatus(Case("point at the centre", "all models", definition), "BehindCamera", CommonStatus(true, point({0, 0, 0})));
  RecordStatus(Case("point behind", "models that are not wide", definition), "BehindCamera",
               CommonStatus(false, point({0.1, 0, -1})));
  RecordStatus(Case("depth 5e-324 m beside 1 m", "models that are not wide", definition), "OutsideValidRadius",
               CommonStatus(false, point({1, 1, least})));
  WorstError worst;
  for (const Camera& camera : testing::OrdinaryLenses()) worst.Add(ProjectionError(camera, {least, -least, 1}, 1));
  RecordDigits(Case("pixel of a point", "5e-324 m beside the axis, worst of all models"), 14, worst.value());
}

/// Rotation vector of an exact quaternion, near the identity and elsewhere: 2 atan2(|v|, w) v / |v|.
Vector3mp LogExactly(const Eigen::Quaterniond& q) {
  const Vector3mp v = q.vec().cast<Mp>();
  const Mp length = v.norm();
  if (length == 0) return Vector3mp(v);
  return v * (2 * atan2(length, Mp(q.w())) / length);
}

TEST(LensDigits, RotationVectors) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
  for (const double angle : {1e-300, 1e-150, 1e-9, 1e-3, 1.0, 3.1, kPi - 1e-9}) {
    const Eigen::Vector3d vector = angle * axis;
    const Eigen::Quaterniond q = RotationExp(vector);
    const Vector3mp half = vector.cast<Mp>() / 2;
    const Mp length = half.norm();
    const Mp error = (q.vec().cast<Mp>() - half * (sin(length) / length)).norm() / sin(length);
    RecordDigits(Case("quaternion of a rotation vector", Format("angle %.10g rad", angle)), 14, static_cast<double>(error));
    const Vector3mp exact = LogExactly(q);
    RecordDigits(Case("rotation vector of a quaternion", Format("angle %.10g rad", angle)), 14,
                 static_cast<double>((RotationLog(q).cast<Mp>() - exact).norm() / exact.norm()));
  }
}

TEST(LensDigits, FarWorldOrigins) {
  Rng rng(4);
  for (const double far : {1e3, 1e6, 1e9}) {
    WorstError worst;
    for (int i = 0; i < 200; ++i) {
      const Rigid3 pose{RotationExp(Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())),
                        far * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())};
      const Eigen::Vector3d x = far * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()), found = pose * x;
      const Eigen::Quaternion<Mp> q(Mp(pose.rotation.w()), Mp(pose.rotation.x()), Mp(pose.rotation.y()), Mp(pose.rotation.z()));
      const Vector3mp exact = q.normalized().toRotationMatrix() * x.cast<Mp>() + pose.translation.cast<Mp>();
      worst.Add(static_cast<double>((found.cast<Mp>() - exact).norm()) / (x.norm() + pose.translation.norm()));
    }
    RecordDigits(Case("point in another frame", Format("coordinates of %g m, 200 transforms", far)), 14, worst.value());
  }
}

}  // namespace
}  // namespace mvstudio::geometry
