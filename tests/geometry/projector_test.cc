#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "core/random.h"
#include "core/units.h"
#include "tests/geometry/exact_lens.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

TEST(Projector, AgreesWithTheFormulaInSixtyDigits) {
  Rng rng(1);
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const Projector projector(camera);
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector3d x(rng.Uniform(-1, 1), rng.Uniform(-0.7, 0.7), rng.Uniform(1.5, 5));
      const Projection projection = projector.Project(x);
      ASSERT_EQ(projection.status, Status::kOk) << camera.name << " " << x.transpose();
      const Vector2mp oracle = ProjectExactly(camera, x);
      ASSERT_LT((projection.px.cast<Mp>() - oracle).norm(), 1e-11L) << camera.name;
    }
  }
}

TEST(Projector, UnprojectsTheWholeImage) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const Projector projector(camera);
    for (double v = -0.5; v <= camera.height_px; v += 31) {
      for (double u = -0.5; u <= camera.width_px; u += 31) {
        const Unprojection unprojection = projector.Unproject({u, v});
        ASSERT_EQ(unprojection.status, Status::kOk) << camera.name << " " << u << " " << v;
        ASSERT_NEAR(unprojection.ray_in_cam.norm(), 1, 1e-15);
        const Vector2mp back = ProjectExactly(camera, unprojection.ray_in_cam);
        ASSERT_LT((back - Vector2mp(u, v)).norm(), 1e-9L) << camera.name << " " << u << " " << v;
      }
    }
  }
}

TEST(Projector, ReturnsTheRayItProjected) {
  Rng rng(2);
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const Projector projector(camera);
    const double reach = std::min(testing::Reach(camera), 0.8);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d ray = Direction(camera.model, rng.Uniform(0, reach), rng.Uniform(0, 2 * kPi)).normalized();
      const Projection projection = projector.Project(ray * rng.Uniform(0.1, 20));
      const Unprojection unprojection = projector.Unproject(projection.px);
      ASSERT_EQ(unprojection.status, Status::kOk) << camera.name;
      ASSERT_LT((unprojection.ray_in_cam - ray).norm(), 1e-12) << camera.name;
    }
  }
}

/// Central difference in 60 digits, right to about 35.
template <class Function>
Vector2mp Derivative(const Function& f, const Mp& at, const Mp& h) {
  return (f(at + h) - f(at - h)) / (2 * h);
}

TEST(Projector, JacobiansAgreeWithFiniteDifferences) {
  Rng rng(3);
  std::vector<Camera> lenses = testing::OrdinaryLenses();
  for (const Camera& camera : testing::ExtremeLenses()) lenses.push_back(camera);
  for (const Camera& camera : lenses) {
    const Projector projector(camera);
    const double reach = testing::Reach(camera);
    for (int i = 0; i < 40; ++i) {
      const Eigen::Vector3d x =
          Direction(camera.model, rng.Uniform(0.01, reach), rng.Uniform(0, 2 * kPi)) * rng.Uniform(0.5, 8);
      const ProjectionWithJacobians result = projector.ProjectWithJacobians(x);
      ASSERT_EQ(result.status, Status::kOk) << camera.name;
      ASSERT_EQ(result.px, projector.Project(x).px);
      const VectorXmp params = camera.params.cast<Mp>();
      const Vector3mp x_exact = x.cast<Mp>();
      for (int j = 0; j < 3; ++j) {
        const auto f = [&](const Mp& value) {
          Vector3mp y = x_exact;
          y[j] = value;
          return ProjectExactly(camera, params, y);
        };
        const Vector2mp oracle = Derivative(f, x_exact[j], Mp("1e-18") * x_exact.norm());
        ASSERT_LT((oracle - result.d_px_d_x.col(j).cast<Mp>()).norm(), 1e-8L * (1 + oracle.norm())) << camera.name << " x" << j;
      }
      ASSERT_EQ(result.d_px_d_params.cols(), camera.params.size());
      for (int j = 0; j < camera.params.size(); ++j) {
        const auto f = [&](const Mp& value) {
          VectorXmp p = params;
          p[j] = value;
          return ProjectExactly(camera, p, x_exact);
        };
        const Vector2mp oracle = Derivative(f, params[j], Mp("1e-18") * (1 + abs(params[j])));
        ASSERT_LT((oracle - result.d_px_d_params.col(j).cast<Mp>()).norm(), 1e-8L * (1 + oracle.norm()))
            << camera.name << " p" << j;
      }
    }
  }
}

TEST(Projector, JacobianOnTheAxisIsThePinholes) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    if (camera.model == LensModel::kSplined) continue;
    const ProjectionWithJacobians result = Projector(camera).ProjectWithJacobians({0, 0, 2});
    ASSERT_EQ(result.status, Status::kOk);
    const bool shifted = ParamNames(camera).size() > 4 && ParamNames(camera)[4] == "xi";
    const double scale = shifted ? 1 + camera.params[4] : 1;
    Eigen::Matrix<double, 2, 3> expected;
    expected << camera.fx() / (2 * scale), 0, 0, 0, camera.fy() / (2 * scale), 0;
    EXPECT_LT((result.d_px_d_x - expected).norm(), 1e-12 * expected.norm()) << camera.name;
    EXPECT_EQ(result.px, Eigen::Vector2d(camera.cx(), camera.cy()));
  }
}

/// The Jacobian of the inverse map is the inverse of the Jacobian.
TEST(Projector, InverseFunctionTheorem) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const Projector projector(camera);
    const Eigen::Vector2d px(0.8 * camera.width_px, 0.3 * camera.height_px);
    const Eigen::Vector3d ray = projector.Unproject(px).ray_in_cam;
    Eigen::Matrix2d numeric;
    for (int j = 0; j < 2; ++j) {
      const double h = 0.05;
      const auto slope = [&](double step) {
        Eigen::Vector2d up = px, down = px;
        up[j] += step, down[j] -= step;
        return Eigen::Vector2d(
            (projector.Unproject(up).ray_in_cam.hnormalized() - projector.Unproject(down).ray_in_cam.hnormalized()) /
            (2 * step));
      };
      numeric.col(j) = (4 * slope(h / 2) - slope(h)) / 3;
    }
    const Eigen::Vector3d x(ray[0] / ray[2], ray[1] / ray[2], 1);
    const Eigen::Matrix2d analytic = projector.ProjectWithJacobians(x).d_px_d_x.leftCols<2>().inverse();
    EXPECT_LT((numeric - analytic).norm(), 1e-9 * analytic.norm()) << camera.name;
  }
}

TEST(Projector, OneOffFormsAgree) {
  const Camera camera = testing::OrdinaryLenses()[4];
  const Eigen::Vector3d x(0.2, -0.1, 1.5);
  EXPECT_EQ(Project(camera, x).px, Projector(camera).Project(x).px);
  EXPECT_EQ(Unproject(camera, {100, 50}).ray_in_cam, Projector(camera).Unproject({100, 50}).ray_in_cam);
  EXPECT_EQ(ValidRadius(camera), Projector(camera).valid_radius());
}

}  // namespace
}  // namespace mvstudio::geometry
