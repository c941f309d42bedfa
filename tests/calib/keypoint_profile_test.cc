#include <Eigen/Dense>
#include <limits>

#include "calib/keypoints/choice.h"
#include "calib/keypoints/profile.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/keypoint_support.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

PeopleOptions Small(int num_frames = 12) {
  PeopleOptions options;
  options.num_frames = num_frames, options.num_joints = 4;
  return options;
}

std::vector<int> GroupsOf(const std::vector<KeypointFit>& fits, int num_groups, int num_frames) {
  std::vector<int> groups;
  for (const KeypointFit& fit : fits) groups.push_back(fit.joint->frame * num_groups / num_frames);
  return groups;
}

KeypointFreedom FocalToo(const geometry::Rig& rig) {
  KeypointPlan plan;
  plan.free_poses = plan.free_focal = true;
  return FreedomOf(rig, plan);
}

/// Projection of all views of all joints, cameras moved by the head of `step` and points by its tail.
Eigen::VectorXd ProjectAll(const KeypointProfile& profile, const Eigen::VectorXd& step) {
  const geometry::Rig rig = Moved(profile.rig, profile.layout, step.head(profile.layout.total));
  std::vector<double> px;
  for (size_t f = 0; f < profile.fits.size(); ++f) {
    const Eigen::Vector3d x =
        profile.fits[f].x_in_world + step.segment<3>(profile.layout.total + 3 * static_cast<Eigen::Index>(f));
    for (const auto& seen : profile.fits[f].joint->seen) {
      const geometry::RigCamera& camera = rig.cameras[static_cast<size_t>(seen.camera_idx)];
      const Eigen::Vector2d at = geometry::Project(camera.camera, camera.cam_from_world * x).px;
      px.push_back(at.x()), px.push_back(at.y());
    }
  }
  return Eigen::Map<Eigen::VectorXd>(px.data(), static_cast<Eigen::Index>(px.size()));
}

/// The dense oracle: derivatives by differences, all cameras and points in one matrix, the points eliminated by LU.
Eigen::MatrixXd DenseCurvature(const KeypointProfile& profile) {
  const Eigen::Index n = profile.layout.total, all = n + 3 * static_cast<Eigen::Index>(profile.fits.size());
  Eigen::MatrixXd j(ProjectAll(profile, Eigen::VectorXd::Zero(all)).size(), all);
  for (Eigen::Index k = 0; k < all; ++k) {
    constexpr double kStep = 1e-6;
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(all, k);
    j.col(k) = (ProjectAll(profile, step) - ProjectAll(profile, -step)) / (2 * kStep);
  }
  Eigen::MatrixXd curvature = Eigen::MatrixXd::Zero(j.rows(), j.rows());
  Eigen::Index row = 0;
  for (const KeypointFit& fit : profile.fits) {
    for (const Eigen::Vector2d& residual : fit.residuals_px) {
      const Eigen::Vector2d r = residual / profile.cauchy_px;
      const double weight = 1 / (1 + r.squaredNorm());
      curvature.block<2, 2>(row, row) = weight * Eigen::Matrix2d::Identity() - 2 * weight * weight * r * r.transpose();
      row += 2;
    }
  }
  const Eigen::MatrixXd h = j.transpose() * curvature * j;
  const Eigen::MatrixXd points = h.bottomRightCorner(all - n, all - n), mixed = h.bottomLeftCorner(all - n, n);
  return h.topLeftCorner(n, n) - mixed.transpose() * points.fullPivLu().solve(mixed);
}

TEST(KeypointProfile, CurvatureIsThatOfTheDenseMatrix) {
  const geometry::Rig rig = PeopleRig(4);
  PeopleOptions options = Small(5);
  options.outlier_fraction = 0;
  const auto joints = JointsOf(rig, FilmPeople(rig, options));
  std::vector<KeypointFit> fits = FitKeypoints(rig, joints, 6, 2, 1);
  for (const KeypointFit& fit : fits) ASSERT_TRUE(fit.ok);
  std::vector<int> groups = GroupsOf(fits, 3, 5);
  const KeypointProfile profile = ProfileOf(rig, std::move(fits), std::move(groups), 3, FocalToo(rig), 6, 1);
  const Eigen::MatrixXd found = CurvatureWithout(profile, {false, false, false}), dense = DenseCurvature(profile);
  ASSERT_EQ(found.rows(), 4 * 7);
  const Eigen::VectorXd scale = dense.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (found - dense) * scale.asDiagonal()).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(KeypointProfile, GradientIsThatOfTheCost) {
  const geometry::Rig truth = PeopleRig(3), rig = testing::Disturbed(truth, 0.002, 0.005, 3);
  const auto joints = JointsOf(truth, FilmPeople(truth, Small()));
  constexpr double kCauchyPx = 4;
  const std::vector<KeypointFit> fits = FitKeypoints(rig, joints, kCauchyPx, 2, 1);
  const KeypointProfile profile = ProfileOf(rig, fits, std::vector<int>(fits.size(), 0), 1, FocalToo(rig), kCauchyPx, 1);
  const auto cost = [&](const Eigen::VectorXd& step) {
    double sum = 0;
    for (const KeypointFit& fit : RefitKeypoints(Moved(rig, profile.layout, step), fits, kCauchyPx, 1)) sum += fit.cost;
    return kCauchyPx * kCauchyPx / 2 * sum;
  };
  for (int k = 0; k < profile.layout.total; ++k) {
    const Eigen::VectorXd step = 1e-5 * Eigen::VectorXd::Unit(profile.layout.total, k);
    EXPECT_NEAR(profile.g[0][k], (cost(step) - cost(-step)) / 2e-5, 1e-3 * profile.g[0].norm()) << k;
  }
}

/// Newton steps end at the minimum that the bundle adjustment of cameras and points finds.
TEST(KeypointProfile, WithoutAGroupTheMinimumIsThatOfTheBundle) {
  const geometry::Rig truth = PeopleRig(4);
  const auto joints = JointsOf(truth, FilmPeople(truth, Small(40)));
  const KeypointSolution whole = SolveKeypoints(truth, joints, {}, 3, 1);
  std::vector<KeypointFit> fits = FitKeypoints(whole.rig, joints, 3, 2, 1);
  std::vector<int> groups = GroupsOf(fits, 5, 40);
  const KeypointProfile profile = ProfileOf(whole.rig, std::move(fits), std::move(groups), 5, {}, 3, 1);
  for (int out = 0; out < 5; ++out) {
    std::vector<bool> left_out(5, false);
    left_out[static_cast<size_t>(out)] = true;
    std::vector<KeypointJoint> rest;
    for (const KeypointJoint& joint : joints)
      if (joint.frame * 5 / 40 != out) rest.push_back(joint);
    const auto newton = SolveWithout(profile, left_out, 1e-12);
    ASSERT_TRUE(newton) << out;
    const KeypointSolution bundle = SolveKeypoints(whole.rig, rest, {}, 3, 1);
    const auto cost = [&](const geometry::Rig& rig) {
      double sum = 0;
      for (const KeypointFit& fit : FitKeypoints(rig, rest, 3, 2, 1)) sum += fit.cost;
      return sum;
    };
    EXPECT_LT(cost(*newton), (1 + 1e-6) * cost(bundle.rig)) << out;
    EXPECT_GT(cost(*newton), (1 - 1e-4) * cost(bundle.rig)) << out;  // the bundle ends within 1e-4 of the minimum
    const geometry::RigDifference moved = geometry::CompareRigs(AlignToGiven(bundle.rig, whole.rig), *newton);
    EXPECT_LT(moved.max_rotation_rad, 2e-4) << out;
  }
}

/// At a bad rig the cost turns down along some motion; what the views determine does not depend on it.
TEST(KeypointProfile, InliersDetermineARigWhateverTheCostDoes) {
  const geometry::Rig truth = PeopleRig(4), off = testing::Disturbed(truth, 0.01, 0.03, 3);
  const std::vector<KeypointJoint> joints = JointsOf(truth, FilmPeople(truth, Small(30)));
  std::vector<KeypointFit> fits = FitKeypoints(off, joints, 6, 2, 1);
  const std::vector<int> groups(fits.size(), 0);
  const KeypointProfile profile = ProfileOf(off, fits, groups, 1, {}, 6, 1);
  const auto smallest = [&](bool of_inliers) {
    const Eigen::MatrixXd h =
        profile.motions.transpose() * CurvatureUnder(profile, profile.layout, of_inliers) * profile.motions;
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(h).eigenvalues()[0];
  };
  EXPECT_LT(smallest(false), 0) << "else this rig tests nothing";
  EXPECT_GT(smallest(true), 1e-6);
}

TEST(KeypointProfile, ThreadsDoNotMatter) {
  const geometry::Rig rig = PeopleRig(4);
  const auto joints = JointsOf(rig, FilmPeople(rig, Small(20)));
  const KeypointSolution solution = SolveKeypoints(rig, joints, {}, 0, 1);
  const KeypointCovariance one = CovarianceOfKeypoints(solution, joints, {}, 1);
  const KeypointCovariance two = CovarianceOfKeypoints(solution, joints, {}, 2);
  ASSERT_EQ(one.status, Status::kOk) << one.message;
  EXPECT_EQ(one.joint, two.joint);
}

Status CovarianceStatus(const geometry::Rig& rig, const std::vector<KeypointJoint>& joints) {
  KeypointSolution solution;
  solution.rig = rig, solution.cauchy_px = 2;
  const KeypointCovariance covariance = CovarianceOfKeypoints(solution, joints, {}, 1);
  if (covariance.status == Status::kOk) {
    EXPECT_TRUE(covariance.joint.allFinite());
  }
  return covariance.status;
}

TEST(KeypointProfile, DegenerateTakesGiveAStatus) {
  const geometry::Rig rig = PeopleRig(4);
  const auto joints = JointsOf(rig, FilmPeople(rig, Small(20)));
  EXPECT_EQ(CovarianceStatus(rig, joints), Status::kOk);

  auto blind = joints;  // camera 2 sees nothing
  for (KeypointJoint& joint : blind) {
    auto& seen = joint.seen;
    seen.erase(std::remove_if(seen.begin(), seen.end(), [](const auto& view) { return view.camera_idx == 2; }), seen.end());
  }
  EXPECT_EQ(CovarianceStatus(rig, blind), Status::kDegenerate);

  auto once = joints;  // a point that one camera sees changes nothing
  once[5].seen.resize(1);
  EXPECT_EQ(CovarianceStatus(rig, once), Status::kOk);
  EXPECT_EQ(SolveKeypoints(rig, once, {}, 2, 1).status, Status::kOk);

  auto one_place = joints;  // all points are one point
  for (KeypointJoint& joint : one_place) joint.seen = joints[0].seen;
  EXPECT_EQ(CovarianceStatus(rig, one_place), Status::kDegenerate);

  auto not_a_number = joints;
  for (KeypointJoint& joint : not_a_number) joint.seen[0].px.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(CovarianceStatus(rig, not_a_number), Status::kDegenerate);
  EXPECT_EQ(SolveKeypoints(rig, not_a_number, {}, 2, 1).status, Status::kTooFewViews);
  EXPECT_EQ(CovarianceStatus(rig, {}), Status::kDegenerate);
}

}  // namespace
}  // namespace mvstudio::calib
