#include "calib/covariance/held_covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "calib/covariance/projection_uncertainty.h"
#include "calib/covariance/uncertainty.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

Eigen::MatrixXd RandomMatrix(Eigen::Index rows, Eigen::Index cols, Rng* rng) {
  Eigen::MatrixXd m(rows, cols);
  for (Eigen::Index i = 0; i < m.size(); ++i) m.data()[i] = rng->Normal();
  return m;
}

/// Linear least squares y = J_x x + J_h h + noise, h held at h + e: the estimate is linear in noise and e, so its covariance is
/// known.
TEST(CovarianceWithHeld, IsThatOfALinearProblem) {
  Rng rng(1);
  const Eigen::MatrixXd j = RandomMatrix(40, 7, &rng), root = RandomMatrix(3, 3, &rng);
  const std::vector<Eigen::Index> estimated = {0, 2, 3, 6}, held = {1, 4, 5};
  const Eigen::MatrixXd jx = j(Eigen::all, estimated), jh = j(Eigen::all, held), s = root * root.transpose();
  const Eigen::MatrixXd inverse = (jx.transpose() * jx).inverse();
  constexpr double kVariance = 0.3;
  const Eigen::MatrixXd joint = CovarianceWithHeld(j.transpose() * j, estimated, held, inverse, kVariance * inverse, s);
  const Eigen::MatrixXd gain = inverse * jx.transpose();  // x = gain (y - J_h h)
  const Eigen::MatrixXd expected = kVariance * gain * gain.transpose() + gain * jh * s * (gain * jh).transpose();
  EXPECT_LT((joint(estimated, estimated) - expected).norm(), 1e-12 * expected.norm());
  EXPECT_LT((joint(estimated, held) + gain * jh * s).norm(), 1e-12 * s.norm());
  EXPECT_EQ(joint(held, held), s);
}

/// The given calibration: the truth with lenses and poses that err by a covariance of its own.
struct Given {
  geometry::Rig rig;
  Eigen::MatrixXd joint;
};

Given MakeGiven(const testing::Scene& scene, double scale, uint64_t seed) {
  Rng rng(seed);
  Given given{testing::TruthRig(scene), {}};
  const Eigen::Index p = given.rig.cameras[0].camera.params.size(),
                     n = (p + 6) * static_cast<Eigen::Index>(given.rig.cameras.size());
  Eigen::VectorXd sigma = Eigen::VectorXd::Constant(n, 1e-3);
  for (Eigen::Index c = 0; c * (p + 6) < n; ++c) sigma.segment<4>(c * (p + 6)).setConstant(0.5);
  const Eigen::MatrixXd root = scale * sigma.asDiagonal() * (Eigen::MatrixXd::Identity(n, n) + 0.2 * RandomMatrix(n, n, &rng));
  given.joint = root * root.transpose();
  geometry::StatedCovariance stated = geometry::StatedCovarianceOf(given.rig);
  stated.joint = given.joint, stated.correlated = true;
  stated.lens_known.assign(given.rig.cameras.size(), true), stated.pose_known = stated.lens_known;
  geometry::StoreCovariance(stated, &given.rig);
  return given;
}

void Perturb(const Eigen::VectorXd& delta, geometry::Rig* rig) {
  Eigen::Index row = 0;
  for (geometry::RigCamera& camera : rig->cameras) {
    const Eigen::Index p = camera.camera.params.size();
    camera.camera.params += delta.segment(row, p);
    camera.cam_from_world = geometry::Perturb(geometry::Vector6d(delta.segment<6>(row + p)), camera.cam_from_world);
    row += p + 6;
  }
}

/// With lenses held at wrong values, the poses err by what is said: Monte Carlo over errors of the lenses and of the corners.
TEST(ComputeCovariance, CarriesTheErrorsOfHeldLenses) {
  constexpr int kSamples = 40;
  constexpr double kNoise = 0.1;
  SceneOptions options;
  options.num_frames = 8;
  double with = 0, without = 0;
  for (int sample = 0; sample < kSamples; ++sample) {
    options.noise_px = kNoise, options.seed = 1;
    testing::Scene scene = MakeScene(options);
    testing::ObserveAll(&scene, kNoise, 900 + static_cast<uint64_t>(sample));
    const Given given = MakeGiven(scene, 1, 5);
    Rng rng(70 + static_cast<uint64_t>(sample));
    geometry::Rig start = given.rig;
    Eigen::VectorXd delta = given.joint.llt().matrixL() * RandomMatrix(given.joint.rows(), 1, &rng);
    Perturb(delta, &start);
    RigState state = scene.truth;
    for (size_t c = 0; c < 2; ++c) state.cameras[c].params = start.cameras[c].camera.params;
    std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
    BundleOptions bundle;
    bundle.reject_outliers = false, bundle.fix_lens = {true, true};
    ASSERT_EQ(SolveBundle(&views, &state, bundle).status, Status::kOk);
    const HeldCovariance held = HeldCovarianceOf(start, state, bundle);
    ASSERT_TRUE(held.lens[0] && held.lens[1] && !held.pose[0]);
    const RigCovariance covariance = ComputeCovariance(views, state, bundle, kNoise, held);
    const RigCovariance exact = ComputeCovariance(views, state, bundle, kNoise);
    ASSERT_EQ(covariance.status, Status::kOk);
    const Eigen::Index p = state.cameras[0].params.size();
    EXPECT_LT((covariance.params[1] - given.joint.block(p + 6, p + 6, p, p)).norm(), 1e-9 * covariance.params[1].norm())
        << "the held lens keeps what was stated of it";
    const geometry::Rigid3 &found = state.cam_from_world[1], &truth = scene.truth.cam_from_world[1];
    geometry::Vector6d error;
    error << geometry::RotationLog(found.rotation * truth.rotation.conjugate()), found.translation - truth.translation;
    with += error.dot(covariance.cam_from_world[1].ldlt().solve(error)) / (6 * kSamples);
    without += error.dot(exact.cam_from_world[1].ldlt().solve(error)) / (6 * kSamples);
  }
  EXPECT_NEAR(with, 1, 3.5 * std::sqrt(2.0 / (6 * kSamples)));
  EXPECT_GT(without, 4) << "taking the lenses for exact would not cover the truth";
}

TEST(ProjectionUncertainty, CountsTheErrorsOfHeldLenses) {
  SceneOptions options;
  options.num_frames = 8;
  const testing::Scene scene = MakeScene(options);
  const Given given = MakeGiven(scene, 1, 6);
  RigState state = scene.truth;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  BundleOptions bundle;
  bundle.fix_lens = {true, true};
  const HeldCovariance held = HeldCovarianceOf(given.rig, state, bundle);
  const ProjectionUncertainty exact(views, state, bundle, 0.1), with(views, state, bundle, 0.1, held);
  const double a = exact.PixelCovariance(1, {600, 240}, 1.2).worst_px(),
               b = with.PixelCovariance(1, {600, 240}, 1.2).worst_px();
  EXPECT_GT(b, 1.2 * a);
  // Many gradients at once take another way through the same numbers.
  EXPECT_NEAR(with.UncertaintyMap(1, 12, 8, 1.2)(0, 0), with.PixelCovariance(1, {0, 0}, 1.2).worst_px(), 1e-9);
}

TEST(HeldCovarianceOf, KnowsOnlyWhatIsStated) {
  const testing::Scene scene = MakeScene({});
  Given given = MakeGiven(scene, 1, 7);
  given.rig.cameras[1].params_covariance.reset();
  BundleOptions bundle;
  bundle.fix_lens = {true, true}, bundle.fix_camera = {true, false};
  const HeldCovariance held = HeldCovarianceOf(given.rig, scene.truth, bundle);
  EXPECT_TRUE(held.lens[0]);
  EXPECT_FALSE(held.lens[1]);
  EXPECT_TRUE(held.pose[0]);
  EXPECT_FALSE(held.pose[1]) << "it is not held";
  EXPECT_FALSE(HeldCovarianceOf(std::nullopt, scene.truth, bundle).any());
}

}  // namespace
}  // namespace mvstudio::calib
