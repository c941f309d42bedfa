#include "calib/covariance/uncertainty.h"

#include <Eigen/Cholesky>

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Errors of one solved scene, in the order of RigCovariance::joint for two cameras with camera 0 fixed.
Eigen::VectorXd Errors(const RigState& found, const RigState& truth) {
  const Eigen::VectorXd a = found.cameras[0].params - truth.cameras[0].params,
                        b = found.cameras[1].params - truth.cameras[1].params;
  const geometry::Rigid3 &f = found.cam_from_world[1], &t = truth.cam_from_world[1];
  Eigen::VectorXd errors(a.size() + b.size() + 6);
  errors << a, b, geometry::RotationLog(f.rotation * t.rotation.conjugate()), f.translation - t.translation;
  return errors;
}

TEST(ComputeCovariance, PredictsTheErrorsOfSeededSolutions) {
  constexpr int kSamples = 30;
  constexpr double kNoise = 0.2;
  double sum = 0;
  Eigen::Index unknowns = 0;
  for (int sample = 0; sample < kSamples; ++sample) {
    SceneOptions options;
    options.num_frames = 10;
    options.noise_px = kNoise;
    testing::Scene scene = MakeScene(options);
    scene.detections.clear();
    Rng rng(500 + sample);
    for (int f = 0; f < options.num_frames; ++f) {
      for (int c = 0; c < 2; ++c) {
        Detection d = testing::Observe(scene, c, f, kNoise, &rng);
        if (d.num_corners() > 0) scene.detections.push_back(d);
      }
    }
    RigState state = scene.truth;
    std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
    BundleOptions bundle;
    bundle.reject_outliers = false;
    ASSERT_EQ(SolveBundle(&views, &state, bundle).status, Status::kOk);
    const RigCovariance covariance = ComputeCovariance(views, state, bundle.gauge, kNoise);
    ASSERT_EQ(covariance.status, Status::kOk) << covariance.message;
    const Eigen::VectorXd errors = Errors(state, scene.truth);
    unknowns = errors.size();
    sum += errors.dot(covariance.joint.ldlt().solve(errors));
  }
  // chi-square with kSamples * unknowns degrees of freedom: 3.5 standard deviations
  const double mean = sum / (kSamples * unknowns), spread = std::sqrt(2.0 / (kSamples * unknowns));
  EXPECT_NEAR(mean, 1, 3.5 * spread);
}

TEST(ComputeCovariance, NamesWhatIsNotDetermined) {
  SceneOptions options;
  options.num_cameras = 1;
  options.max_tilt_rad = 0;
  options.model = geometry::LensModel::kPinhole;
  const auto scene = MakeScene(options);
  RigState state = scene.truth;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  const RigCovariance covariance = ComputeCovariance(views, state, Gauge(), 1);
  EXPECT_EQ(covariance.status, Status::kDegenerate);
  ASSERT_FALSE(covariance.undetermined.empty());
  EXPECT_NE(covariance.undetermined[0].find("focal length of cam0 and the distance of its boards"), std::string::npos)
      << covariance.undetermined[0];
  EXPECT_NE(covariance.message.find("all boards are parallel to the image"), std::string::npos) << covariance.message;
  EXPECT_TRUE(covariance.params.empty()) << "no covariance is made up";
}

TEST(ComputeCovariance, GaugeFixesACameraOrABoard) {
  const auto scene = MakeScene({});
  RigState state = scene.truth;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  const RigCovariance camera = ComputeCovariance(views, state, Gauge{Gauge::Kind::kCamera, 0}, 0.1);
  const RigCovariance board = ComputeCovariance(views, state, Gauge{Gauge::Kind::kBoard, 3}, 0.1);
  ASSERT_EQ(camera.status, Status::kOk);
  ASSERT_EQ(board.status, Status::kOk);
  EXPECT_EQ(camera.cam_from_world[0].norm(), 0);
  EXPECT_GT(board.cam_from_world[0].trace(), 0);
  for (int c = 0; c < 2; ++c) {  // intrinsics do not depend on the gauge
    EXPECT_LT((camera.params[c] - board.params[c]).norm(), 1e-6 * camera.params[c].norm());
  }
}

}  // namespace
}  // namespace mvstudio::calib
