#include "calib/calibrate.h"
#include "calib/corners/corner_files.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

/// Corners of real recordings, calibrated with nothing but their board: the figures that peers reach on them, or the best that
/// is reached here where that is more (said so).
namespace mvstudio::calib {
namespace {

CalibrateReport Solve(const std::string& path, const CornerFileOptions& file_options, const CalibrateOptions& options) {
  const CornerFile file = ReadCornerFile(path, file_options);
  CalibrateInput input;
  input.boards = file.boards;
  input.cameras = file.cameras;
  input.detections = file.detections;
  RunContext run;
  run.num_threads = 2;
  return Calibrate(input, options, run);
}

TEST(Recordings, WideLensGetsASplineAndABentBoard) {
  MVS_NEEDS_DATA("mrcal_figueroa");
  const std::string folder = mvstudio::testing::DataRoot() + "/" + "mrcal_figueroa";
  CornerFileOptions corners;
  corners.board = ParseBoard("grid:10x10:77mm");
  corners.sizes = {{"", 6016, 4016}};
  CalibrateOptions options;
  options.intrinsics_only = true;
  options.holdout_views = 200;
  const CalibrateReport report = Solve(folder + "/corners-cam0.vnl", corners, options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_EQ(report.cameras[0].model, geometry::LensModel::kSplined) << report.cameras[0].model_reason;
  EXPECT_LE(report.holdout_median_px, 0.455);
  EXPECT_LE(report.holdout_gross_fraction, 0.005);
  // The bend belongs to the lens model: mrcal's own solutions of these corners (calobject_warp in the .cameramodel files of the
  // set) have -0.969 and +0.529 mm with its splined lens, -1.040 and +0.525 with OPENCV8. Within 5 % of each.
  EXPECT_NEAR(1e3 * report.board_warp_m[0].x(), -0.969, 0.048);
  EXPECT_NEAR(1e3 * report.board_warp_m[0].y(), 0.529, 0.026);
  options.model = geometry::LensModel::kRational8;
  options.warp = AutoOnOff::kOn;
  options.stretch = AutoOnOff::kOff;
  const CalibrateReport lean = Solve(folder + "/corners-cam0.vnl", corners, options);
  ASSERT_EQ(lean.status, Status::kOk) << lean.message;
  EXPECT_NEAR(1e3 * lean.board_warp_m[0].x(), -1.040, 0.052);
  EXPECT_NEAR(1e3 * lean.board_warp_m[0].y(), 0.525, 0.026);
  EXPECT_GT(lean.holdout_median_px, 1.1 * report.holdout_median_px) << "the lean lens is the worse one";
}

TEST(Recordings, OmnidirectionalLensIsFoundFromNoGuess) {
  MVS_NEEDS_DATA("opencv_omni_charuco");
  const std::string folder = mvstudio::testing::DataRoot() + "/" + "opencv_omni_charuco";
  const CalibrateReport report = Solve(folder + "/omni_calib_data.xml", {}, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_TRUE(geometry::IsWide(report.cameras[0].model));
  const std::string model(geometry::ToString(report.cameras[0].model));
  EXPECT_EQ(model.substr(model.size() - 2), "_p") << "the lens needs decentring";
  EXPECT_LE(report.rms_px, 0.814);
  EXPECT_EQ(report.cameras[0].num_views, 15);
}

TEST(Recordings, FisheyePairLosesNoView) {
  MVS_NEEDS_DATA("opencv_omni_charuco");
  const std::string folder = mvstudio::testing::DataRoot() + "/" + "opencv_omni_charuco";
  CornerFileOptions corners;
  corners.unit = LengthUnit::kMillimetre;
  const CalibrateReport report = Solve(folder + "/omni_stereocalib_data.xml", corners, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LE(report.rms_px, 0.445) << "OpenCV's omnidir, skew included, without four of the views";
  ASSERT_EQ(report.board_stretch.size(), 1u) << report.stretch_reason;
  EXPECT_NEAR(report.board_stretch[0].x(), -0.0024, 0.0005) << "the board's sides are not square to each other";
  for (const CameraReport& camera : report.cameras) EXPECT_EQ(camera.num_views, 39) << camera.name;
}

TEST(Recordings, HandHeldBoardOfFourWebcams) {
  MVS_NEEDS_DATA("caliscope");
  const std::string folder = mvstudio::testing::DataRoot() + "/" + "caliscope";
  CalibrateOptions options;
  options.holdout = {4, 3};
  const CalibrateReport report = Solve(folder + "/sessions/post_optimization/calibration/extrinsic/xy.csv", {}, options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LE(report.board_metrics.pair_rms_mm, 0.945);
  EXPECT_LE(report.board_metrics.reprojection_rms_px, 1.348);
  EXPECT_NEAR(report.cameras[1].time_offset_frames, -0.6, 0.1) << report.time_reason;
}

/// The time steps that the peer held out.
TEST(Recordings, HandHeldBoardOnThePeersTimeSteps) {
  MVS_NEEDS_DATA("caliscope");
  const std::string folder = mvstudio::testing::DataRoot() + "/" + "caliscope";
  CalibrateOptions options;
  options.holdout = {4, 0};
  const std::string path = folder + "/sessions/post_optimization/calibration/extrinsic/xy.csv";
  const CalibrateReport report = Solve(path, {}, options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LE(report.board_metrics.pair_rms_mm, 0.945);
  EXPECT_LE(report.board_metrics.reprojection_rms_px, 1.348);
  options.time_offset = TimeOffsetChoice::kNone;
  options.model = geometry::LensModel::kBrown4;  // the peer's lens
  const CalibrateReport same = Solve(path, {}, options);
  ASSERT_EQ(same.status, Status::kOk) << same.message;
  EXPECT_LE(same.board_metrics.pair_rms_mm, 0.945);
  EXPECT_LE(same.board_metrics.reprojection_rms_px, 1.348);
}

}  // namespace
}  // namespace mvstudio::calib
