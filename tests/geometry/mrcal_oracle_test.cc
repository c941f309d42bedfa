#include <cmath>
#include <string>
#include <vector>

#include "core/random.h"
#include "core/units.h"
#include "geometry/lens/camera_model.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/lens/models/spline_grid.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

extern "C" {
#include <mrcal/mrcal.h>
}

/// libmrcal projects the same points through the same parameters.
namespace mvstudio::geometry {
namespace {

std::string MrcalName(const Camera& camera) {
  switch (camera.model) {
    case LensModel::kPinhole:
      return "LENSMODEL_PINHOLE";
    case LensModel::kBrown4:
      return "LENSMODEL_OPENCV4";
    case LensModel::kBrown5:
      return "LENSMODEL_OPENCV5";
    case LensModel::kRational8:
      return "LENSMODEL_OPENCV8";
    case LensModel::kThinPrism12:
      return "LENSMODEL_OPENCV12";
    case LensModel::kSplined:
      return "LENSMODEL_SPLINED_STEREOGRAPHIC_order=" + std::to_string(camera.spline.order) +
             "_Nx=" + std::to_string(camera.spline.cols) + "_Ny=" + std::to_string(camera.spline.rows) +
             "_fov_x_deg=" + std::to_string(camera.spline.fov_x_deg);
    default:
      return "";
  }
}

mrcal_lensmodel_t MrcalLens(const Camera& camera) {
  mrcal_lensmodel_t lens;
  EXPECT_TRUE(mrcal_lensmodel_from_name(&lens, MrcalName(camera).c_str())) << camera.name;
  EXPECT_EQ(mrcal_lensmodel_num_params(&lens), NumParams(camera));
  return lens;
}

struct MrcalResult {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, 3> d_px_d_x;
  Eigen::Matrix<double, 2, Eigen::Dynamic> d_px_d_params;
};

MrcalResult MrcalProject(const Camera& camera, const Eigen::Vector3d& x) {
  const mrcal_lensmodel_t lens = MrcalLens(camera);
  mrcal_point2_t q;
  mrcal_point3_t p, by_p[2];
  p.x = x[0], p.y = x[1], p.z = x[2];
  std::vector<double> by_params(2 * camera.params.size());
  EXPECT_TRUE(mrcal_project(&q, by_p, by_params.data(), &p, 1, &lens, camera.params.data()));
  MrcalResult result;
  result.px << q.x, q.y;
  result.d_px_d_x << by_p[0].x, by_p[0].y, by_p[0].z, by_p[1].x, by_p[1].y, by_p[1].z;
  result.d_px_d_params =
      Eigen::Map<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>>(by_params.data(), 2, camera.params.size());
  return result;
}

void ExpectAgreement(const Camera& camera, const Eigen::Vector3d& x) {
  const MrcalResult expected = MrcalProject(camera, x);
  Eigen::Vector2d px, by_formula;
  LensDerivatives d;
  ASSERT_TRUE(ProjectLens(camera, x, &px, &d));
  ASSERT_TRUE(ProjectByFormula<double>(camera.model, camera.params.data(), x, &by_formula, camera.spline));
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(2, camera.params.size());
  for (int j = 0; j < d.count; ++j) dense.col(d.columns[j]) = d.d_px.col(j);
  const double size = 1 + expected.px.norm();
  ASSERT_LT((px - expected.px).norm(), 1e-12 * size) << camera.name << " " << x.transpose();
  ASSERT_LT((by_formula - expected.px).norm(), 1e-12 * size) << camera.name << " " << x.transpose();
  ASSERT_LT((d.d_px_d_x_in_cam - expected.d_px_d_x).norm(), 1e-10 * (1 + expected.d_px_d_x.norm()))
      << camera.name << " " << x.transpose();
  ASSERT_LT((dense - expected.d_px_d_params).norm(), 1e-10 * (1 + dense.norm())) << camera.name << " " << x.transpose();
}

TEST(MrcalOracle, SharedModelsProjectTheSame) {
  Rng rng(21);
  int models = 0;
  for (const Camera& camera : testing::OrdinaryLenses()) {
    if (MrcalName(camera).empty()) continue;
    ++models;
    const double reach = testing::Reach(camera);
    for (int i = 0; i < 300; ++i) {
      ExpectAgreement(
          camera, testing::Direction(camera.model, rng.Uniform(0.001, reach), rng.Uniform(0, 2 * kPi)) * rng.Uniform(0.2, 9));
    }
  }
  EXPECT_EQ(models, 7);
}

/// Every grid, up to and beyond its border, and behind the camera.
TEST(MrcalOracle, SplinesOfEveryGrid) {
  Rng rng(22);
  for (const SplineGrid& grid : {SplineGrid{3, 4, 4, 90}, SplineGrid{2, 3, 3, 60}, SplineGrid{3, 30, 20, 200},
                                 SplineGrid{2, 16, 11, 170}, SplineGrid{3, 5, 14, 40}, SplineGrid{2, 4, 3, 300}}) {
    const Camera camera = testing::MakeSplined(grid, 0.05);
    const double reach = std::min(3.0, 1.3 * DegToRad(grid.fov_x_deg) / 2);
    for (int i = 0; i < 300; ++i) {
      ExpectAgreement(
          camera, testing::Direction(camera.model, rng.Uniform(0.001, reach), rng.Uniform(0, 2 * kPi)) * rng.Uniform(0.2, 9));
    }
  }
}

TEST(MrcalOracle, KnotsLieWhereMrcalPutsThem) {
  const Camera camera = testing::MakeSplined({3, 11, 10, 150}, 0.05);
  const mrcal_lensmodel_t lens = MrcalLens(camera);
  std::vector<double> ux(camera.spline.cols), uy(camera.spline.rows);
  ASSERT_TRUE(mrcal_knots_for_splined_models(ux.data(), uy.data(), &lens));
  const double scale = SegmentsPerU(camera.spline);
  for (int i = 0; i < camera.spline.cols; ++i) EXPECT_NEAR(ux[i], (i - 5.0) / scale, 1e-14);
  for (int i = 0; i < camera.spline.rows; ++i) EXPECT_NEAR(uy[i], (i - 4.5) / scale, 1e-14);
  EXPECT_NEAR(SplineHalfSize(camera.spline)[0], ux[9], 1e-14);
}

TEST(MrcalOracle, InversesAgree) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    if (MrcalName(camera).empty()) continue;
    const mrcal_lensmodel_t lens = MrcalLens(camera);
    const Projector projector(camera);
    for (double v = 3; v < camera.height_px; v += 119) {
      for (double u = 5; u < camera.width_px; u += 127) {
        mrcal_point2_t q;
        mrcal_point3_t ray;
        q.x = u, q.y = v;
        ASSERT_TRUE(mrcal_unproject(&ray, &q, 1, &lens, camera.params.data()));
        const Unprojection own = projector.Unproject({u, v});
        ASSERT_EQ(own.status, Status::kOk) << camera.name;
        // mrcal's solver stops at some 1e-6 px.
        ASSERT_LT((own.ray_in_cam - Eigen::Vector3d(ray.x, ray.y, ray.z).normalized()).norm(), 1e-6) << camera.name;
      }
    }
  }
}

}  // namespace
}  // namespace mvstudio::geometry
