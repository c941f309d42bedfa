#include "calib/covariance/frame_errors.h"

#include <cmath>

#include "calib/bundle/view_clusters.h"
#include "calib/covariance/board_errors.h"
#include "calib/covariance/uncertainty.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

constexpr double kCornerNoisePx = 0.1;

struct SolvedRig {
  std::vector<View> views;
  RigState state;
  BundleOptions bundle;
  double sigma_px = 0;
  double pose_errors = 0;  // mean square of the poses' errors in their own standard deviations, by corners alone
  double ratio = 1;
};

/// Mean square of a camera's pose error in its own standard deviations.
double InSigmas(const geometry::Rigid3& found, const geometry::Rigid3& truth, const Eigen::Matrix<double, 6, 6>& covariance) {
  geometry::Vector6d error;
  error << geometry::RotationLog(found.rotation * truth.rotation.conjugate()), found.translation - truth.translation;
  return error.dot(covariance.ldlt().solve(error)) / 6;
}

/// Four cameras; each image is shifted by `shift_px` (one sigma per coordinate) beside the noise of its corners.
SolvedRig SolvedWithShift(double shift_px, uint64_t seed) {
  testing::SceneOptions options;
  options.num_cameras = 4, options.num_frames = 14, options.model = geometry::LensModel::kBrown2, options.seed = seed;
  options.noise_px = kCornerNoisePx;
  testing::Scene scene = testing::MakeScene(options);
  SolvedRig solved;
  solved.state = scene.truth;
  solved.views = MakeViews({scene.board}, scene.detections, &solved.state.frames);
  Rng shift(seed + 31);
  for (View& view : solved.views) view.px.colwise() += shift_px * Eigen::Vector2d(shift.Normal(), shift.Normal());
  solved.bundle.reject_outliers = false;
  const BundleReport report = SolveBundle(&solved.views, &solved.state, solved.bundle);
  EXPECT_EQ(report.status, Status::kOk);
  solved.sigma_px = report.sigma_px;
  const RigCovariance covariance = ComputeCovariance(solved.views, solved.state, solved.bundle, solved.sigma_px);
  for (size_t c = 1; c < 4; ++c)
    solved.pose_errors +=
        InSigmas(solved.state.cam_from_world[c], scene.truth.cam_from_world[c], covariance.cam_from_world[c]) / 3;
  const std::vector<int> of_frame = ClusterFrames(solved.views, ClusterViews(solved.views), solved.state.frames.size());
  solved.ratio = PoseVarianceByFrames(solved.views, of_frame, solved.state, solved.bundle, solved.sigma_px);
  return solved;
}

TEST(PoseVarianceByFrames, IndependentCornersKeepTheirs) {
  double sum = 0;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    const double ratio = SolvedWithShift(0, seed).ratio;
    EXPECT_LT(ratio, 1.6) << seed;
    sum += ratio;
  }
  EXPECT_LT(sum / 12, 1.15);
}

/// Shifts that hardly show in the residuals, since every image is its corners' average.
TEST(PoseVarianceByFrames, ImagesThatShiftSayHowFarTheCamerasAreOff) {
  double by_corners = 0, by_frames = 0, residuals = 0;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    const SolvedRig solved = SolvedWithShift(0.1, seed);
    EXPECT_GT(solved.ratio, 2) << seed;
    by_corners += solved.pose_errors / 12;
    by_frames += solved.pose_errors / solved.ratio / 12;
    residuals += solved.sigma_px / 12;
  }
  EXPECT_LT(residuals, 1.5 * kCornerNoisePx);
  EXPECT_GT(std::sqrt(by_corners), 1.7) << "corners alone claim too much";
  EXPECT_LT(std::sqrt(by_frames), 1.3);
  EXPECT_GT(std::sqrt(by_frames), 0.6) << "nor is it claimed to be worse than it is";
}

/// The lens as each image sees it for itself takes the shift up, so that the lenses' own ratio cannot show it.
TEST(PoseVarianceByFrames, SeesWhatOneImageAloneCannot) {
  const SolvedRig solved = SolvedWithShift(0.1, 5);
  for (const double ratio : VarianceByBoards(solved.views, ClusterViews(solved.views), solved.state)) EXPECT_LT(ratio, 2);
  EXPECT_GT(solved.ratio, 2);
}

TEST(PoseVarianceByFrames, FewFramesAndHeldPosesHaveOne) {
  SolvedRig solved = SolvedWithShift(0.1, 2);
  const std::vector<int> one(solved.state.frames.size(), 0);
  EXPECT_EQ(PoseVarianceByFrames(solved.views, one, solved.state, solved.bundle, solved.sigma_px), 1) << "one place";
  const std::vector<int> of_frame = ClusterFrames(solved.views, ClusterViews(solved.views), solved.state.frames.size());
  solved.bundle.fix_camera.assign(4, true);
  EXPECT_EQ(PoseVarianceByFrames(solved.views, of_frame, solved.state, solved.bundle, solved.sigma_px), 1) << "nothing free";
}

}  // namespace
}  // namespace mvstudio::calib
