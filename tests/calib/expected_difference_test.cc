#include "calib/check/expected_difference.h"

#include <cmath>

#include "core/random.h"
#include "geometry/rig/alignment.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

namespace mvstudio::calib {
namespace {

using geometry::Rig;
using geometry::RigCamera;

/// Ten pixels at one metre and more: focal lengths known to 1 px, principal points to 2 px, distortion to 0.001.
RigCamera Lens() {
  RigCamera camera;
  camera.camera = geometry::testing::MakeLens(geometry::LensModel::kBrown4, {-0.28, 0.09, 0.0011, -0.0017});
  Eigen::VectorXd sigmas(8);
  sigmas << 1, 1, 2, 2, 1e-3, 2e-3, 1e-4, 1e-4;
  camera.params_covariance = sigmas.cwiseAbs2().asDiagonal().toDenseMatrix();
  return camera;
}

RigCamera Drawn(RigCamera camera, Rng* random) {
  for (Eigen::Index i = 0; i < camera.camera.params.size(); ++i)
    camera.camera.params[i] += std::sqrt((*camera.params_covariance)(i, i)) * random->Normal();
  return camera;
}

/// The mean square over pairs of calibrations that are drawn from their covariances is the expected one.
TEST(ExpectedDifference, IsThatOfDrawnLenses) {
  const RigCamera lens = Lens();
  for (const bool implied : {true, false}) {
    ProjectionDiffOptions options;
    options.implied = implied;
    const std::vector<double> expected = ExpectedProjectionRms(lens, lens, options);
    std::vector<double> squares(expected.size(), 0);
    Rng random(7);
    constexpr int kPairs = 200;
    for (int i = 0; i < kPairs; ++i) {
      const ProjectionDiff diff = CompareProjection(Drawn(lens, &random).camera, Drawn(lens, &random).camera, options);
      for (size_t r = 0; r < squares.size(); ++r) squares[r] += diff.ranges[r].rms_px * diff.ranges[r].rms_px / kPairs;
    }
    for (size_t r = 0; r < squares.size(); ++r)
      EXPECT_NEAR(std::sqrt(squares[r]) / expected[r], 1, 0.15) << "implied " << implied << " range " << r;
  }
}

/// Closed form: without distortion and without an implied motion, a principal point known to s px differs by s sqrt(2) per
/// axis.
TEST(ExpectedDifference, OfAPrincipalPointAlone) {
  RigCamera lens;
  lens.camera = geometry::MakePinhole("a", 640, 480, 500);
  lens.params_covariance = Eigen::Vector4d(0, 0, 0.09, 0.09).asDiagonal().toDenseMatrix();
  ProjectionDiffOptions options;
  options.implied = false;
  for (const double expected : ExpectedProjectionRms(lens, lens, options)) EXPECT_NEAR(expected, 0.6, 1e-9);
  options.implied = true;  // a small rotation makes up for nearly all of it
  EXPECT_LT(ExpectedProjectionRms(lens, lens, options).back(), 0.2);
}

TEST(ExpectedDifference, UnknownIsNotZero) {
  RigCamera known = Lens(), unknown = known;
  unknown.params_covariance.reset();
  for (const double expected : ExpectedProjectionRms(known, unknown)) EXPECT_TRUE(std::isnan(expected));
  Rig rig;
  rig.cameras = {known, unknown};
  rig.cameras[1].camera.name = "b";
  for (const PoseDifference& expected : ExpectedPoseDifferences(rig, rig)) EXPECT_TRUE(std::isnan(expected.rotation_rad));
}

Rig Ring(double sigma_rad, double sigma_m) {
  Rig rig;
  for (int i = 0; i < 5; ++i) {
    const double angle = 1.2 * i;
    RigCamera camera = triangulate::LookAt("c" + std::to_string(i), {3 * std::cos(angle), 3 * std::sin(angle), 1}, {0, 0, 1});
    Eigen::Matrix<double, 6, 1> sigmas;
    sigmas << sigma_rad, sigma_rad, sigma_rad, sigma_m, sigma_m, sigma_m;
    camera.cam_from_world_covariance = sigmas.cwiseAbs2().asDiagonal().toDenseMatrix();
    rig.cameras.push_back(camera);
  }
  return rig;
}

/// A rig drawn from the covariances lies within what is expected; one whose camera was turned does not.
TEST(ExpectedDifference, FindsTheCameraThatWasRotated) {
  const Rig reference = Ring(1e-4, 1e-3);
  const auto expected = ExpectedPoseDifferences(reference, reference);
  Rng random(11);
  Rig rig = reference;
  for (RigCamera& camera : rig.cameras) {
    geometry::Vector6d delta;
    for (int i = 0; i < 6; ++i) delta[i] = (i < 3 ? 1e-4 : 1e-3) * random.Normal();
    camera.cam_from_world = geometry::Perturb(delta, camera.cam_from_world);
  }
  const auto times = [&](size_t camera) {
    const auto differences = PoseDifferences(rig, reference, geometry::CompareRigs(rig, reference).reference_from_rig);
    return differences[camera].rotation_rad / expected[camera].rotation_rad;
  };
  for (size_t c = 0; c < rig.cameras.size(); ++c) EXPECT_LT(times(c), 2);
  geometry::Vector6d turn = geometry::Vector6d::Zero();
  turn[1] = 2e-3;
  rig.cameras[2].cam_from_world = geometry::Perturb(turn, rig.cameras[2].cam_from_world);
  EXPECT_GT(times(2), 5);
}

}  // namespace
}  // namespace mvstudio::calib
