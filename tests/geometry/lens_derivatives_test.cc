#include "geometry/lens/lens_derivatives.h"

#include <cmath>

#include "core/random.h"
#include "core/units.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

TEST(ProjectLens, AgreesWithTheProjector) {
  Rng rng(11);
  for (const Camera& camera : AllLenses()) {
    const Projector projector(camera);
    const double reach = testing::Reach(camera);
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d x = Direction(camera.model, rng.Uniform(0, reach), rng.Uniform(0, 2 * kPi)) * rng.Uniform(0.5, 8);
      const ProjectionWithJacobians expected = projector.ProjectWithJacobians(x);
      ASSERT_EQ(expected.status, Status::kOk);
      Eigen::Vector2d px, px_alone;
      LensDerivatives derivatives;
      ASSERT_TRUE(ProjectLens(camera, x, &px, &derivatives));
      ASSERT_TRUE(ProjectLens(camera, x, &px_alone, nullptr));
      ASSERT_EQ(px, px_alone);
      ASSERT_LT((px - expected.px).norm(), 1e-11 * (1 + px.norm())) << camera.name;
      const int order = camera.spline.order;
      ASSERT_EQ(derivatives.count, camera.model == LensModel::kSplined ? 4 + 2 * (order + 1) * (order + 1) : NumParams(camera));
      Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(2, camera.params.size());
      for (int j = 0; j < derivatives.count; ++j) {
        ASSERT_TRUE(j == 0 || derivatives.columns[j] > derivatives.columns[j - 1]);
        dense.col(derivatives.columns[j]) = derivatives.d_px.col(j);
      }
      ASSERT_LT((derivatives.d_px_d_x_in_cam - expected.d_px_d_x).norm(), 1e-11 * expected.d_px_d_x.norm()) << camera.name;
      ASSERT_LT((dense - expected.d_px_d_params).norm(), 1e-11 * expected.d_px_d_params.norm()) << camera.name;
    }
  }
}

/// D of ucm, eucm and doublesphere at (0, 0, -1), see sphere.h: straight behind, some of them have a formula.
double Denominator(const Camera& camera) {
  const double p = camera.params[4], q = camera.params.size() > 5 ? camera.params[5] : 0;
  if (camera.model == LensModel::kUcm || camera.model == LensModel::kUcmP) return p - 1;
  if (camera.model == LensModel::kEucm || camera.model == LensModel::kEucmP) return 2 * p - 1;
  return q * std::abs(p - 1) + (1 - q) * (p - 1);
}

TEST(ProjectLens, RefusesWhatHasNoFormula) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    Eigen::Vector2d px;
    EXPECT_FALSE(ProjectLens(camera, {0, 0, 0}, &px, nullptr));
    const bool sphere = camera.model >= LensModel::kUcm && camera.model <= LensModel::kDoubleSphereP && IsWide(camera.model);
    EXPECT_EQ(ProjectLens(camera, {0, 0, -1}, &px, nullptr),
              sphere && camera.model != LensModel::kKannalaBrandt4P && Denominator(camera) > 0)
        << camera.name;
    EXPECT_FALSE(ProjectLens(camera, {std::nan(""), 0, 1}, &px, nullptr));
    EXPECT_FALSE(ProjectLens(camera, {0, 0, std::nan("")}, &px, nullptr));
  }
}

}  // namespace
}  // namespace mvstudio::geometry
