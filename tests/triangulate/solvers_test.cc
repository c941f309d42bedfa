#include "triangulate/point/solvers.h"

#include <gtest/gtest.h>

#include "tests/triangulate/oracle.h"
#include "tests/triangulate/support.h"
#include "triangulate/point/refine.h"

extern "C" {
#include <mrcal/basic-geometry.h>
#include <mrcal/triangulation.h>
}

namespace mvstudio::triangulate {
namespace {

using oracle::Mp;

std::vector<View> Views(const PreparedRig& rig, const std::vector<Observation>& observations) {
  Status rejected;
  return MakeViews(rig, observations, &rejected);
}

/// Pinholes, so that an oracle needs no lens.
geometry::Rig PinholeRing(int num_cameras) {
  geometry::Rig rig = MakeRing(num_cameras);
  for (geometry::RigCamera& camera : rig.cameras) camera.camera = geometry::PinholeOf(camera.camera);
  return rig;
}

TEST(Solvers, NamesGoBothWays) {
  for (const Solver solver : kAllSolvers) EXPECT_EQ(SolverFromString(ToString(solver)), solver);
  EXPECT_FALSE(SolverFromString("mid3"));
  for (const PointMethod method : kAllPointMethods) EXPECT_EQ(PointMethodFromString(ToString(method)), method);
  EXPECT_EQ(PointMethodFromString("auto"), PointMethod::kRobust);
  EXPECT_FALSE(PointMethodFromString("robuster"));
  EXPECT_EQ(SolverOf(PointMethod::kLost), Solver::kLost);
  EXPECT_EQ(SolverOf(PointMethod::kWmid2), Solver::kWmid2);
  EXPECT_EQ(SolverOf(PointMethod::kRobust), Solver::kMaximumLikelihood);
}

TEST(Solvers, AllRecoverNoiseFreePoints) {
  Rng rng(1);
  for (const int num_cameras : {3, 5, 8, 31}) {
    const geometry::Rig rig = MakeRing(num_cameras);
    const PreparedRig prepared = Prepare(rig);
    for (int trial = 0; trial < 30; ++trial) {
      const Eigen::Vector3d truth = RandomPoint(&rng);
      std::vector<View> views = Views(prepared, Observe(rig, truth));
      for (const Solver solver : kAllSolvers) {
        if (IsTwoView(solver)) views.resize(2);
        const LinearPoint point = Solve(solver, Views(prepared, Observe(rig, truth)));
        ASSERT_EQ(point.status, Status::kOk) << ToString(solver);
        EXPECT_LT((point.x_in_local + prepared.origin_in_world - truth).norm(), 1e-11) << ToString(solver);
      }
    }
  }
}

TEST(Solvers, DegenerateRaysAreNamed) {
  geometry::Rig parallel;
  for (const double y : {-1.0, 1.0}) parallel.cameras.push_back(LookAt("c" + std::to_string(y), {0, y, 0}, {10, y, 0}));
  geometry::Rig one_centre;
  for (const double y : {-1.0, 1.0}) one_centre.cameras.push_back(LookAt("c" + std::to_string(y), {1, 2, 3}, {10, y, 0}));
  const PreparedRig prepared = Prepare(parallel), same = Prepare(one_centre);
  const Eigen::Vector2d middle(639.5, 479.5);
  const std::vector<View> no_parallax = Views(prepared, {{0, middle, 1, 1}, {1, middle, 1, 1}});
  const std::vector<View> no_baseline = Views(same, {{0, middle, 1, 1}, {1, middle, 1, 1}});
  for (const Solver solver : kAllSolvers) {
    EXPECT_EQ(Solve(solver, no_parallax).status, Status::kDegenerate) << ToString(solver);
    EXPECT_EQ(Solve(solver, {no_parallax[0]}).status, Status::kTooFewViews) << ToString(solver);
    const LinearPoint at_centre = Solve(solver, no_baseline);  // or no point at all
    if (at_centre.status == Status::kOk) {
      EXPECT_LT((at_centre.x_in_local - no_baseline[0].camera->center_in_local).norm(), 1e-9) << ToString(solver);
    }
  }
}

TEST(Solvers, TwoViewFormsRefuseRaysThatMeetBehind) {
  const geometry::Rig rig = TwoCameras(DegToRad(30));
  std::vector<View> views = Views(Prepare(rig), Observe(rig, {0.1, 0, 0}));
  const PreparedRig prepared = Prepare(rig);
  for (View& view : views) view.camera = &prepared.cameras[view.observation_idx];
  for (View& view : views) view.ray_in_local *= -1;
  for (const Solver solver : {Solver::kMid2, Solver::kWmid2, Solver::kL1, Solver::kLinf}) {
    EXPECT_EQ(Solve(solver, views).status, Status::kBehindCamera) << ToString(solver);
  }
}

// libmrcal has its own implementation of the four closed forms, in the frame of the first camera.
TEST(Solvers, TwoViewFormsAgreeWithMrcal) {
  Rng rng(3);
  using Function = mrcal_point3_t (*)(mrcal_point3_t*, mrcal_point3_t*, mrcal_point3_t*, const mrcal_point3_t*,
                                      const mrcal_point3_t*, const mrcal_point3_t*);
  const std::pair<Solver, Function> pairs[] = {{Solver::kMid2, mrcal_triangulate_leecivera_mid2},
                                               {Solver::kWmid2, mrcal_triangulate_leecivera_wmid2},
                                               {Solver::kL1, mrcal_triangulate_leecivera_l1},
                                               {Solver::kLinf, mrcal_triangulate_leecivera_linf}};
  for (const double deg : {2.0, 20.0, 60.0, 90.0, 150.0}) {
    const geometry::Rig rig = TwoCameras(DegToRad(deg));
    const PreparedRig prepared = Prepare(rig);
    for (int trial = 0; trial < 40; ++trial) {
      const std::vector<View> views = Views(prepared, Observe(rig, RandomPoint(&rng, 0.5), 3, &rng));
      const auto to_mrcal = [](const Eigen::Vector3d& x) {
        mrcal_point3_t p;
        p.x = x.x(), p.y = x.y(), p.z = x.z();
        return p;
      };
      const mrcal_point3_t v0 = to_mrcal(views[0].ray_in_local), v1 = to_mrcal(views[1].ray_in_local);
      const mrcal_point3_t t01 = to_mrcal(views[1].camera->center_in_local - views[0].camera->center_in_local);
      for (const auto& [solver, function] : pairs) {
        const mrcal_point3_t theirs = function(nullptr, nullptr, nullptr, &v0, &v1, &t01);
        const LinearPoint ours = Solve(solver, views);
        ASSERT_EQ(ours.status, Status::kOk);
        const Eigen::Vector3d expected = views[0].camera->center_in_local + Eigen::Vector3d(theirs.x, theirs.y, theirs.z);
        EXPECT_LT((ours.x_in_local - expected).norm(), 1e-9) << ToString(solver) << ", " << deg << " deg";
      }
    }
  }
}

TEST(Solvers, TwoViewFormsTakeTheWidestPair) {
  geometry::Rig rig;
  for (const double deg : {0.0, 2.0, 80.0, 4.0}) {
    rig.cameras.push_back(
        LookAt("c" + std::to_string(deg), 3 * Eigen::Vector3d(std::cos(DegToRad(deg)), std::sin(DegToRad(deg)), 0), {0, 0, 0}));
  }
  const PreparedRig prepared = Prepare(rig);
  Rng rng(5);
  const std::vector<View> views = Views(prepared, Observe(rig, {0.1, 0.05, 0.2}, 1, &rng));
  EXPECT_EQ(Solve(Solver::kMid2, views).x_in_local, Mid2(views[0], views[2]).x_in_local);
}

/// Rows of a pinhole's plane coordinates a, b: a P3 - P1, b P3 - P2, in 60 digits and local coordinates.
Eigen::Matrix<Mp, 2, 4> RowsOf(const geometry::RigCamera& camera, const Eigen::Vector2d& px, const Eigen::Vector3d& origin) {
  const oracle::Matrix3 r = oracle::Rotation(camera.cam_from_world);
  const oracle::Vector3 t = r * oracle::ToMp(origin) + oracle::ToMp(camera.cam_from_world.translation);
  Eigen::Matrix<Mp, 3, 4> p;
  p << r, t;
  Eigen::Matrix<Mp, 2, 4> rows;
  for (int k = 0; k < 2; ++k) {
    const Mp plane = (Mp(px[k]) - Mp(camera.camera.params[2 + k])) / Mp(camera.camera.params[k]);
    rows.row(k) = plane * p.row(2) - p.row(k);
  }
  return rows;
}

TEST(Solvers, LinearFormsSolveTheirEquationsExactly) {
  const geometry::Rig rig = PinholeRing(5);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(7);
  for (int trial = 0; trial < 10; ++trial) {
    const std::vector<Observation> observations = Observe(rig, RandomPoint(&rng), 4, &rng);
    Eigen::Matrix<Mp, 4, 4> normal = Eigen::Matrix<Mp, 4, 4>::Zero();
    Mp extent = 0;
    for (const Observation& seen : observations) {
      const auto rows = RowsOf(rig.cameras[seen.camera_idx], seen.px, prepared.origin_in_world);
      normal += rows.transpose() * rows;
      const oracle::Vector3 center = oracle::Center(rig.cameras[seen.camera_idx]) - oracle::ToMp(prepared.origin_in_world);
      extent = std::max(extent, Mp(center.norm()));
    }
    const std::vector<View> views = Views(prepared, observations);
    const oracle::Matrix3 block = normal.topLeftCorner<3, 3>();
    const oracle::Vector3 least_squares = -(block.inverse() * normal.topRightCorner<3, 1>());
    EXPECT_LT((InhomogeneousLeastSquares(views).x_in_local - oracle::ToDouble(least_squares)).norm(), 1e-13);

    // Smallest eigenvector by inverse iteration, the last unknown in units of the rig's extent as in the solver.
    Eigen::Matrix<Mp, 4, 4> scaled = normal;
    scaled.row(3) /= extent;
    scaled.col(3) /= extent;
    Eigen::Matrix<Mp, 4, 1> v(Mp(0.1), Mp(0.2), Mp(0.3), Mp(1));
    const Eigen::Matrix<Mp, 4, 4> inverse = scaled.inverse();
    for (int i = 0; i < 200; ++i) v = (inverse * v).normalized();
    const oracle::Vector3 dlt(v[0] / v[3] * extent, v[1] / v[3] * extent, v[2] / v[3] * extent);
    EXPECT_LT((HomogeneousDlt(views).x_in_local - oracle::ToDouble(dlt)).norm(), 1e-12);
  }
}

// The paper's formula: q_i S [x_i]x R_i (X - p_i) = 0 with x_i = (a, b, 1) and q_i = |x_i| / (sigma gamma_i), gamma_i by the
// law of sines with the view of largest parallax.
TEST(Solvers, LostIsThePapersFormula) {
  const geometry::Rig rig = PinholeRing(5);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(9);
  for (int trial = 0; trial < 10; ++trial) {
    std::vector<Observation> observations = Observe(rig, RandomPoint(&rng), 4, &rng);
    for (size_t i = 0; i < observations.size(); ++i) observations[i].sigma_px = 1.0 + static_cast<double>(i);
    std::vector<oracle::Vector3> directions, centers;
    for (const Observation& seen : observations) {
      const geometry::RigCamera& camera = rig.cameras[seen.camera_idx];
      const oracle::Vector3 x((Mp(seen.px[0]) - Mp(camera.camera.cx())) / Mp(camera.camera.fx()),
                              (Mp(seen.px[1]) - Mp(camera.camera.cy())) / Mp(camera.camera.fy()), Mp(1));
      directions.push_back(oracle::Rotation(camera.cam_from_world).transpose() * x);
      centers.push_back(oracle::Center(camera));
    }
    oracle::Matrix3 normal = oracle::Matrix3::Zero();
    oracle::Vector3 right = oracle::Vector3::Zero();
    for (size_t i = 0; i < observations.size(); ++i) {
      size_t partner = i == 0 ? 1 : 0;
      const auto sine = [&](size_t j) {
        const Mp length = directions[i].cross(directions[j]).norm() / (directions[i].norm() * directions[j].norm());
        return length;
      };
      for (size_t j = 0; j < observations.size(); ++j) {
        if (j != i && sine(j) > sine(partner)) partner = j;
      }
      const Mp q = directions[i].cross(directions[partner]).norm() /
                   ((centers[partner] - centers[i]).cross(directions[partner]).norm() * Mp(observations[i].sigma_px));
      const geometry::RigCamera& camera = rig.cameras[observations[i].camera_idx];
      const oracle::Matrix3 r = oracle::Rotation(camera.cam_from_world);
      const oracle::Vector3 x = r * directions[i];
      Eigen::Matrix<Mp, 2, 3> rows;
      rows.row(0) = q * (x[1] * r.row(2) - x[2] * r.row(1));
      rows.row(1) = q * (x[2] * r.row(0) - x[0] * r.row(2));
      normal += rows.transpose() * rows;
      right += rows.transpose() * (rows * centers[i]);
    }
    const oracle::Vector3 expected = normal.inverse() * right;
    const Eigen::Vector3d found = Lost(Views(prepared, observations)).x_in_local + prepared.origin_in_world;
    EXPECT_LT((found - oracle::ToDouble(expected)).norm(), 1e-12);
  }
}

TEST(Solvers, LostIsTheMostLikelyPointToFirstOrder) {
  geometry::Rig rig = MakeRing(6);
  rig.cameras.push_back(LookAt("close", {0.5, 0.1, 0.9}, {0, 0, 0}));  // weights matter: it is three times nearer
  const PreparedRig prepared = Prepare(rig);
  Rng rng(11);
  double lost = 0, midpoint = 0, own = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d truth = RandomPoint(&rng, 0.2);
    const std::vector<View> views = Views(prepared, Observe(rig, truth, 0.5, &rng, 0.5));
    const Eigen::Vector3d best = Solve(Solver::kMaximumLikelihood, views).x_in_local;
    lost += (Lost(views).x_in_local - best).norm();
    midpoint += (Midpoint(views).x_in_local - best).norm();
    own += (best + prepared.origin_in_world - truth).norm();
  }
  EXPECT_LT(lost, 0.01 * own);
  EXPECT_LT(lost, 0.05 * midpoint);
}

// 60 digits: the most likely point of noisy views, for 2 to 520 of them.
TEST(Solvers, MaximumLikelihoodIsTheOptimum) {
  Rng rng(13);
  for (const int num_views : {2, 3, 8, 31, 520}) {
    const geometry::Rig rig = MakeRing(std::max(num_views, 3));
    const PreparedRig prepared = Prepare(rig);
    const Eigen::Vector3d truth = RandomPoint(&rng);
    std::vector<Observation> observations = Observe(rig, truth, 1, &rng);
    observations.resize(num_views);
    const Point point = TriangulatePoint(prepared, observations, {PointMethod::kAllViews});
    ASSERT_EQ(point.status, Status::kOk);
    const oracle::Optimum best = oracle::MostLikely(rig, observations, truth, num_views > 100 ? 8 : 40);
    const Eigen::Vector3d apart = point.x_in_world - oracle::ToDouble(best.x_in_world);
    EXPECT_LT(std::sqrt(apart.dot(point.covariance.inverse() * apart)), 1e-6) << num_views;
    EXPECT_NEAR(point.chi_squared / static_cast<double>(best.chi_squared), 1, 1e-9);
    const oracle::Matrix3 covariance = best.information.inverse();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        EXPECT_NEAR(point.covariance(i, j), static_cast<double>(covariance(i, j)), 1e-6 * point.covariance.trace());
      }
    }
  }
}

}  // namespace
}  // namespace mvstudio::triangulate
