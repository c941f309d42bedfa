#include "triangulate/point/calibration_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "tests/triangulate/support.h"

namespace mvstudio::triangulate {
namespace {

/// Random positive definite joint covariance: strong correlations between a lens, its pose and the other cameras.
void GiveCovariance(geometry::Rig* rig, Rng* rng, double scale) {
  Eigen::VectorXd sigma(15 * static_cast<Eigen::Index>(rig->cameras.size()));
  for (size_t c = 0; c < rig->cameras.size(); ++c) {
    sigma.segment<15>(15 * static_cast<Eigen::Index>(c)) << 2, 2, 3, 3, 4e-3, 4e-3, 4e-4, 4e-4, 2e-3, 2e-3, 2e-3, 2e-3, 4e-3,
        4e-3, 4e-3;
  }
  const Eigen::Index n = sigma.size();
  Eigen::MatrixXd mix = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) mix(i, j) += 0.3 * rng->Normal();
  }
  mix = scale * sigma.asDiagonal() * mix;
  const Eigen::MatrixXd joint = mix * mix.transpose();
  rig->joint_covariance = 0.5 * (joint + joint.transpose());
  for (size_t c = 0; c < rig->cameras.size(); ++c) {
    const Eigen::Index begin = 15 * static_cast<Eigen::Index>(c);
    rig->cameras[c].params_covariance = rig->joint_covariance->block<9, 9>(begin, begin);
    rig->cameras[c].cam_from_world_covariance = rig->joint_covariance->block<6, 6>(begin + 9, begin + 9);
  }
}

/// The rig moved by a vector in the layout of the joint covariance.
geometry::Rig Moved(const geometry::Rig& rig, const Eigen::VectorXd& delta) {
  geometry::Rig moved = rig;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Eigen::Index begin = 15 * static_cast<Eigen::Index>(c);
    moved.cameras[c].camera.params += delta.segment<9>(begin);
    moved.cameras[c].cam_from_world =
        geometry::Perturb(geometry::Vector6d(delta.segment<6>(begin + 9)), moved.cameras[c].cam_from_world);
  }
  return moved;
}

TEST(CalibrationCovariance, IsTheFirstOrderEffectOfMovingTheRig) {
  Rng rng(3);
  geometry::Rig rig = MakeRing(4, 3, {200, -100, 30});  // the pose's perturbation turns about the world's origin
  GiveCovariance(&rig, &rng, 1e-6);
  const Eigen::Vector3d truth = Eigen::Vector3d(200, -100, 30) + RandomPoint(&rng);
  const std::vector<Observation> seen = Observe(rig, truth);
  Point point = TriangulatePoint(Prepare(rig), seen);
  ASSERT_EQ(point.status, Status::kOk);
  AddCalibrationCovariance(Prepare(rig), seen, &point);
  Eigen::MatrixXd d_x(3, rig.joint_covariance->rows());
  for (Eigen::Index k = 0; k < d_x.cols(); ++k) {
    const double h = 0.01 * std::sqrt((*rig.joint_covariance)(k, k));
    const Eigen::VectorXd step = h * Eigen::VectorXd::Unit(d_x.cols(), k);
    const Point plus = TriangulatePoint(Prepare(Moved(rig, step)), seen);
    const Point minus = TriangulatePoint(Prepare(Moved(rig, -step)), seen);
    d_x.col(k) = (plus.x_in_world - minus.x_in_world) / (2 * h);
  }
  const Eigen::Matrix3d expected = d_x * *rig.joint_covariance * d_x.transpose();
  EXPECT_LT((point.calibration_covariance - expected).norm(), 1e-3 * expected.norm());
}

TEST(CalibrationCovariance, CoversErrorsOfCalibrationAndDetections) {
  constexpr int kTrials = 1500;
  Rng rng(5);
  geometry::Rig truth_rig = MakeRing(5);
  GiveCovariance(&truth_rig, &rng, 1);
  const Eigen::MatrixXd root = truth_rig.joint_covariance->llt().matrixL();
  int inside68 = 0, inside95 = 0, detections_only95 = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::VectorXd normal = Eigen::VectorXd::NullaryExpr(root.rows(), [&rng]() { return rng.Normal(); });
    const Eigen::Vector3d x = RandomPoint(&rng, 0.3);
    const std::vector<Observation> seen = Observe(truth_rig, x, 1.0, &rng);
    const PreparedRig calibrated = Prepare(Moved(truth_rig, root * normal));
    PointOptions options;
    options.method = PointMethod::kAllViews;
    Point point = TriangulatePoint(calibrated, seen, options);
    ASSERT_EQ(point.status, Status::kOk);
    const Eigen::Vector3d error = point.x_in_world - x;
    detections_only95 += error.dot(point.covariance.inverse() * error) < 7.8147279;
    AddCalibrationCovariance(calibrated, seen, &point);
    const double distance = error.dot(point.covariance.inverse() * error);
    inside68 += distance < 3.5058820;
    inside95 += distance < 7.8147279;
  }
  EXPECT_NEAR(inside68 / double{kTrials}, 0.68, 4 * std::sqrt(0.68 * 0.32 / kTrials));
  EXPECT_NEAR(inside95 / double{kTrials}, 0.95, 4 * std::sqrt(0.95 * 0.05 / kTrials));
  EXPECT_LT(detections_only95 / double{kTrials}, 0.5) << "the calibration must matter in this test";
}

TEST(CalibrationCovariance, NothingIsAddedWithoutOne) {
  Rng rng(7);
  const geometry::Rig rig = MakeRing(4);
  const std::vector<Observation> seen = Observe(rig, RandomPoint(&rng));
  Point point = TriangulatePoint(Prepare(rig), seen);
  const Eigen::Matrix3d before = point.covariance;
  AddCalibrationCovariance(Prepare(rig), seen, &point);
  EXPECT_EQ(point.covariance, before);
  EXPECT_EQ(point.num_unknown_cameras, 4);
}

/// One camera without a block: the others' part stays, what is lost is its own, and the point says so.
TEST(CalibrationCovariance, AMissingBlockLeavesTheOthersInPlace) {
  Rng rng(8);
  geometry::Rig rig = MakeRing(4);
  GiveCovariance(&rig, &rng, 1);
  const std::vector<Observation> seen = Observe(rig, RandomPoint(&rng));
  const Point alone = TriangulatePoint(Prepare(rig), seen);
  Point whole = alone, partial = alone, others = alone;
  AddCalibrationCovariance(Prepare(rig), seen, &whole);
  EXPECT_EQ(whole.num_unknown_cameras, 0);
  // The same as an exact fourth camera, but marked.
  geometry::Rig exact = rig, missing = rig;
  missing.cameras[3].params_covariance.reset(), missing.cameras[3].cam_from_world_covariance.reset();
  exact.joint_covariance->bottomRows<15>().setZero(), exact.joint_covariance->rightCols<15>().setZero();
  exact.cameras[3].params_covariance->setZero(), exact.cameras[3].cam_from_world_covariance->setZero();
  AddCalibrationCovariance(Prepare(missing), seen, &partial);
  AddCalibrationCovariance(Prepare(exact), seen, &others);
  EXPECT_EQ(partial.num_unknown_cameras, 1);
  EXPECT_EQ(others.num_unknown_cameras, 0);
  EXPECT_LT((partial.covariance - others.covariance).norm(), 1e-12 * others.covariance.norm());
  EXPECT_GT(partial.calibration_covariance.trace(), 0.1 * whole.calibration_covariance.trace());
}

TEST(CalibrationCovariance, AStaleOneIsNotUsed) {
  Rng rng(9);
  geometry::Rig rig = MakeRing(3);
  GiveCovariance(&rig, &rng, 1);
  EXPECT_TRUE(HasJointCovariance(rig));
  rig.cameras.erase(rig.cameras.begin());
  EXPECT_FALSE(HasJointCovariance(rig));
  EXPECT_GT(Prepare(rig).covariance.size(), 0) << "the cameras' own blocks remain";
  EXPECT_EQ((Prepare(rig).covariance.block<15, 15>(0, 15).norm()), 0);
}

TEST(DuplicateCameras, DoNotHalveTheCovariance) {
  Rng rng(11);
  geometry::Rig rig = MakeRing(3);
  const Eigen::Vector3d x = RandomPoint(&rng);
  std::vector<Observation> seen = Observe(rig, x, 1.0, &rng);
  const Point once = TriangulatePoint(Prepare(rig), seen);
  for (int copy = 0; copy < 2; ++copy) {
    rig.cameras.push_back(rig.cameras[1]);
    seen.push_back(seen[1]);
    seen.back().camera_idx = 3 + copy;
  }
  const Point thrice = TriangulatePoint(Prepare(rig), seen);
  ASSERT_EQ(thrice.status, Status::kOk);
  EXPECT_LT((thrice.covariance - once.covariance).norm(), 1e-9 * once.covariance.norm());
  EXPECT_LT((thrice.x_in_world - once.x_in_world).norm(), 1e-9);
  EXPECT_EQ(thrice.used.size(), 3u);
}

}  // namespace
}  // namespace mvstudio::triangulate
