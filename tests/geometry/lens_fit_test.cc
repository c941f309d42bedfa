#include "geometry/lens/lens_fit.h"

#include <cmath>

#include "core/error.h"
#include "core/units.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

const Camera& Ordinary(LensModel model) {
  static const std::vector<Camera> lenses = testing::OrdinaryLenses();
  return lenses[static_cast<size_t>(model)];
}

/// Largest pixel difference over the rays of a grid finer than the fit's own, up to `max_angle`.
double LargestDifference(const Camera& from, const Camera& to, double max_angle) {
  const Projector a(from), b(to);
  double largest = 0;
  for (double v = 0; v < from.height_px; v += 11) {
    for (double u = 0; u < from.width_px; u += 11) {
      const Unprojection ray = a.Unproject({u, v});
      if (ray.status != Status::kOk || std::acos(ray.ray_in_cam[2]) > max_angle) continue;
      const Projection there = b.Project(ray.ray_in_cam);
      EXPECT_EQ(there.status, Status::kOk) << u << " " << v;
      largest = std::max(largest, (there.px - Eigen::Vector2d(u, v)).norm());
    }
  }
  return largest;
}

/// Cosine between the residuals and the column of the Jacobian that they have most in common with: 0 at an optimum.
double Stationarity(const Camera& from, const LensFit& fit) {
  const Projector projector(from);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(fit.camera.params.size()), size = gradient;
  double residual = 0;
  const LensFitOptions options;
  const int rows = static_cast<int>(std::lround(1.0 * options.grid_cols * from.height_px / from.width_px));
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < options.grid_cols; ++i) {
      const Eigen::Vector2d px((from.width_px - 1.0) * i / (options.grid_cols - 1), (from.height_px - 1.0) * j / (rows - 1));
      const Unprojection ray = projector.Unproject(px);
      if (ray.status != Status::kOk || std::acos(ray.ray_in_cam[2]) > fit.max_angle * (1 + 1e-12)) continue;
      const ProjectionWithJacobians there = Projector(fit.camera).ProjectWithJacobians(ray.ray_in_cam);
      gradient += there.d_px_d_params.transpose() * (there.px - px);
      size += there.d_px_d_params.colwise().squaredNorm().transpose();
      residual += (there.px - px).squaredNorm();
    }
  }
  return (gradient.array() / (size.array().sqrt() * std::sqrt(residual))).abs().maxCoeff();
}

void ExpectFit(const Camera& from, LensModel to, double max_px) {
  const LensFit fit = FitLens(from, to);
  EXPECT_EQ(fit.status, Status::kOk) << from.name << " -> " << ToString(to);
  EXPECT_EQ(fit.camera.model, to);
  EXPECT_EQ(fit.camera.name, from.name);
  EXPECT_EQ(fit.num_lost, 0);
  EXPECT_LE(fit.rms_px, fit.max_px);
  EXPECT_LT(fit.max_px, max_px) << from.name << " -> " << ToString(to);
  EXPECT_LT(LargestDifference(from, fit.camera, fit.max_angle), 2 * max_px) << from.name << " -> " << ToString(to);
}

TEST(FitLens, EveryModelReproducesItself) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    if (camera.model != LensModel::kSplined) ExpectFit(camera, camera.model, 1e-6);
  }
}

TEST(FitLens, WiderModelsOfAFamilyAreExact) {
  const LensModel ladder[] = {LensModel::kPinhole, LensModel::kBrown1,    LensModel::kBrown2,     LensModel::kBrown4,
                              LensModel::kBrown5,  LensModel::kRational8, LensModel::kThinPrism12};
  for (size_t i = 0; i + 1 < std::size(ladder); ++i) ExpectFit(Ordinary(ladder[i]), ladder[i + 1], 1e-6);
  ExpectFit(Ordinary(LensModel::kBrown1), LensModel::kBrown1P, 1e-6);
  ExpectFit(Ordinary(LensModel::kBrown1P), LensModel::kBrown4, 1e-6);
  ExpectFit(Ordinary(LensModel::kPinhole), LensModel::kPinholeP, 1e-6);
  ExpectFit(Ordinary(LensModel::kKannalaBrandt4), LensModel::kKannalaBrandt4P, 1e-6);
  ExpectFit(Ordinary(LensModel::kUcm), LensModel::kUcmP, 1e-6);
  ExpectFit(Ordinary(LensModel::kEucm), LensModel::kEucmP, 1e-6);
  ExpectFit(Ordinary(LensModel::kDoubleSphere), LensModel::kDoubleSphereP, 1e-6);
}

/// ucm is eucm with beta = 1 and alpha = xi / (1 + xi), and double sphere without its second sphere's shift.
TEST(FitLens, FindsTheClosedFormsBetweenSphereModels) {
  const Camera ucm = Ordinary(LensModel::kUcm);
  const LensFit eucm = FitLens(ucm, LensModel::kEucm);
  EXPECT_LT(eucm.max_px, 1e-6);
  EXPECT_NEAR(eucm.camera.params[4], 1.2 / 2.2, 1e-7);
  EXPECT_NEAR(eucm.camera.params[5], 1, 1e-7);
  EXPECT_NEAR(eucm.camera.fx(), ucm.fx() / 2.2, 1e-5);
  const LensFit pinhole = FitLens(Ordinary(LensModel::kPinhole), LensModel::kUcm);
  EXPECT_LT(pinhole.max_px, 1e-6);
  EXPECT_NEAR(pinhole.camera.params[4], 0, 1e-9);
}

/// What the models differ by, and that no better fit lies near.
TEST(FitLens, BetweenFamilies) {
  const struct {
    LensModel from, to;
    double max_px;
  } cases[] = {
      {LensModel::kPinhole, LensModel::kKannalaBrandt4, 0.1},
      {LensModel::kBrown2, LensModel::kKannalaBrandt4, 0.6},
      {LensModel::kRational8, LensModel::kKannalaBrandt4, 2},
      {LensModel::kRational8, LensModel::kBrown5, 0.6},
      {LensModel::kKannalaBrandt4, LensModel::kEucm, 1.2},
      {LensModel::kKannalaBrandt4, LensModel::kDoubleSphere, 1.5},
      {LensModel::kKannalaBrandt4, LensModel::kUcm, 3},
      {LensModel::kEucm, LensModel::kDoubleSphere, 1.5},
      {LensModel::kDoubleSphere, LensModel::kKannalaBrandt4, 0.1},
      {LensModel::kBrown4, LensModel::kKannalaBrandt4P, 1.5},
  };
  for (const auto& [from, to, max_px] : cases) {
    ExpectFit(Ordinary(from), to, max_px);
    EXPECT_LT(Stationarity(Ordinary(from), FitLens(Ordinary(from), to)), 1e-4) << ToString(from) << " -> " << ToString(to);
  }
  ExpectFit(Ordinary(LensModel::kBrown5), LensModel::kRational8, 1e-6);
}

TEST(FitLens, SplinesReproduceEveryModel) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const SplineGrid grid = SplineGridFor(camera, 3, 24);
    const LensFit fit = FitLens(camera, LensModel::kSplined, {}, grid);
    EXPECT_EQ(fit.status, Status::kOk) << camera.name;
    EXPECT_EQ(fit.num_lost, 0) << camera.name;
    const double bound = camera.model == LensModel::kSplined ? 2 : 0.05;
    EXPECT_LT(fit.max_px, bound) << camera.name;
    EXPECT_LT(LargestDifference(camera, fit.camera, kPi), 2 * bound) << camera.name;
  }
}

/// On the same grid the control points come back, where rays see them.
TEST(FitLens, SplineReproducesItself) {
  const Camera camera = testing::MakeSplined({3, 11, 10, 150}, 0.01);
  const LensFit fit = FitLens(camera, LensModel::kSplined, {}, camera.spline);
  // The cores differ by the spline's slope at the axis, so that the surfaces differ too: the same pixels all the same.
  EXPECT_LT(fit.max_px, 0.05);
}

TEST(FitLens, FromSplinedToRational) {
  const Camera smooth =
      FitLens(Ordinary(LensModel::kRational8), LensModel::kSplined, {}, SplineGridFor(Ordinary(LensModel::kRational8), 3, 16))
          .camera;
  ExpectFit(smooth, LensModel::kRational8, 0.02);
}

TEST(FitLens, LongLensesAndKeptPrincipalPoints) {
  const Camera longest = MakeLens(LensModel::kBrown2, {-0.5, 2.0}, 1280, 960, 1e5);
  ExpectFit(longest, LensModel::kKannalaBrandt4, 1e-6);
  ExpectFit(longest, LensModel::kRational8, 1e-6);
  LensFitOptions options;
  options.keep_principal_point = true;
  const Camera from = Ordinary(LensModel::kBrown4);
  const LensFit fit = FitLens(from, LensModel::kBrown2, options);
  EXPECT_EQ(fit.camera.cx(), from.cx());
  EXPECT_EQ(fit.camera.cy(), from.cy());
}

TEST(FitLens, LeavesTheRotationAloneWhereNoneIs) {
  LensFitOptions options;
  options.fit_rotation = true;
  for (const LensModel model : {LensModel::kKannalaBrandt4, LensModel::kEucm, LensModel::kRational8}) {
    const LensFit fit = FitLens(Ordinary(model), model, options);
    EXPECT_LT(fit.max_px, 1e-6) << ToString(model);
    EXPECT_LT(fit.new_from_old.vec().norm(), 1e-7) << ToString(model);
  }
}

TEST(FitLens, PerspectiveModelsStopAtEightyDegrees) {
  const Camera fisheye = MakeLens(LensModel::kKannalaBrandt4, {0.01, 0, 0, 0}, 1280, 960, 300);
  const LensFit fit = FitLens(fisheye, LensModel::kRational8);
  EXPECT_LE(fit.max_angle, DegToRad(80));
  EXPECT_GT(fit.max_angle, DegToRad(75));
  LensFitOptions options;
  options.max_angle = 1;
  EXPECT_LE(FitLens(fisheye, LensModel::kUcm, options).max_angle, 1);
}

TEST(FitLens, RefusesBadInput) {
  EXPECT_THROW(FitLens(Ordinary(LensModel::kPinhole), LensModel::kSplined), ContractViolation);
  Camera blind = MakeLens(LensModel::kBrown1, {-0.4});
  blind.params[2] = -1e5;
  EXPECT_EQ(FitLens(blind, LensModel::kPinhole).status, Status::kTooFewViews);
}

}  // namespace
}  // namespace mvstudio::geometry
