#include <algorithm>

#include "calib/lens/intrinsics.h"
#include "geometry/rig/plausible.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

testing::Scene MakeRecording() {
  testing::SceneOptions options;
  options.model = geometry::LensModel::kBrown2;
  options.noise_px = 0.2;
  return testing::MakeScene(options);
}

/// The first reason with a code; empty: there is none.
std::string Said(const CalibrateReport& report, const std::string& code) {
  for (const Notice& reason : report.verdict.reasons)
    if (reason.code == code) return reason.text;
  return "";
}

TEST(Verdict, CornersBeyondTheToldSizeAreSaid) {
  CalibrateInput input = testing::ToInput(MakeRecording());
  EXPECT_EQ(Said(Calibrate(input, testing::PlainOptions(), {}), "CAL-SIZE"), "");
  input.cameras[1].width_px = 320, input.cameras[1].height_px = 240;
  const CalibrateReport report = Calibrate(input, testing::PlainOptions(), {});
  EXPECT_NE(Said(report, "CAL-SIZE").find("cam1"), std::string::npos);
  EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
}

TEST(Verdict, ABoardThatNobodyPrintsIsSaid) {
  CalibrateInput input = testing::ToInput(MakeRecording());
  EXPECT_EQ(Said(Calibrate(input, testing::PlainOptions(), {}), "CAL-UNIT"), "");
  for (const double wrong : {1000.0, 1e-4}) {
    CalibrateInput other = input;
    other.boards[0].square_m *= wrong;
    EXPECT_NE(Said(Calibrate(other, testing::PlainOptions(), {}), "CAL-UNIT"), "") << wrong;
  }
}

TEST(Verdict, ACentreOutsideTheImageIsSaid) {
  CalibrateReport report = Calibrate(testing::ToInput(MakeRecording()), testing::PlainOptions(), {});
  EXPECT_EQ(Said(report, "CAL-CENTRE"), "");
  report.rig.cameras[1].camera.params[3] = -5;
  report.verdict = Judge(report);
  EXPECT_NE(Said(report, "CAL-CENTRE").find("cam1"), std::string::npos);
}

TEST(Verdict, ALateCameraIsSaidWhereTheBoardsMotionDoesNotExplainIt) {
  CalibrateReport report = Calibrate(testing::ToInput(testing::MakeScene({})), testing::PlainOptions(), {});
  CameraReport& camera = report.cameras[1];
  const auto said = [&](double offset_frames, double rms_px, int num_rejected) {
    camera.time_offset_frames = offset_frames, camera.rms_px = rms_px, camera.num_rejected = num_rejected;
    report.verdict = Judge(report);
    return Said(report, "CAL-LATE");
  };
  camera.alone_rms_px = 0.3;
  EXPECT_EQ(said(0.4, 0.31, 0), "");
  EXPECT_EQ(said(0.01, 0.9, 0), "");
  EXPECT_NE(said(0.4, 0.5, 0).find(camera.name), std::string::npos);
  EXPECT_NE(said(-0.4, 0.3, camera.num_corners).find("0.40 frames early"), std::string::npos);
  EXPECT_NE(said(0.4, 0.5, 0).find("0.40 frames late"), std::string::npos);
}

TEST(Verdict, FiguresThatCannotBeAreNotSaid) {
  CalibrateReport report = Calibrate(testing::ToInput(MakeRecording()), testing::PlainOptions(), {});
  CameraReport& camera = report.cameras[0];
  camera.readout.frames = 12.5, camera.readout.sigma_frames = 0.1, camera.readout.shift_px = 1;
  report.verdict = Judge(report);
  EXPECT_EQ(Said(report, "CAL-ROLLING"), "");
  camera.readout.frames = 0.6;
  report.verdict = Judge(report);
  EXPECT_NE(Said(report, "CAL-ROLLING"), "");
}

TEST(Verdict, CellsThatAreNotSquareAreNamedWithTheirSides) {
  CalibrateReport report = Calibrate(testing::ToInput(MakeRecording()), testing::PlainOptions(), {});
  report.rig.boards = {{"chessboard:9x6:30mm", Eigen::Vector2d::Zero(), Eigen::Vector2d(0, -0.04)}};
  report.verdict = Judge(report);
  EXPECT_NE(Said(report, "CAL-LENGTHS").find("8.3 % higher than wide"), std::string::npos) << Said(report, "CAL-LENGTHS");
  for (const Notice& reason : report.verdict.reasons) {
    if (reason.code != "CAL-LENGTHS") continue;
    EXPECT_NE(reason.hint.find("option 'board' chessboard:9x6:30x32.5mm"), std::string::npos) << reason.hint;
  }
  report.rig.boards[0].stretch = Eigen::Vector2d(0, 0.002);  // a printer's
  report.verdict = Judge(report);
  EXPECT_EQ(Said(report, "CAL-LENGTHS"), "");
}

TEST(Verdict, OneCameraIsNotToldOfOthers) {
  testing::SceneOptions options;
  options.num_cameras = 1;
  CalibrateReport report = Calibrate(testing::ToInput(testing::MakeScene(options)), testing::PlainOptions(), {});
  CameraReport& camera = report.cameras[0];
  camera.num_lost_views = 9, camera.num_rejected = camera.num_corners, camera.holdout_rms_px = 5;
  report.verdict = Judge(report);
  EXPECT_NE(Said(report, "CAL-LOST"), "");
  for (const Notice& reason : report.verdict.reasons) {
    EXPECT_EQ(reason.hint.find("same time"), std::string::npos) << reason.code;
    EXPECT_EQ(reason.hint.find("synchron"), std::string::npos) << reason.code;
    EXPECT_EQ(reason.hint.find("cameras"), std::string::npos) << reason.code << ": " << reason.hint;
  }
}

TEST(Verdict, WhatNoCauseExplainsIsSaid) {
  CalibrateReport report = Calibrate(testing::ToInput(MakeRecording()), testing::PlainOptions(), {});
  report.unexplained = "none of the known causes explains it", report.unexplained_px = 0.5;
  EXPECT_EQ(Judge(report).outcome(), Outcome::kWarn);
  report.unexplained_px = 5;
  EXPECT_EQ(Judge(report).outcome(), Outcome::kFail);
}

/// One camera's corners without an error, of which a fifth is rejected by `off_px`.
CalibrateReport WithRejected(double off_px) {
  CalibrateReport report = Calibrate(testing::ToInput(MakeRecording()), testing::PlainOptions(), {});
  int rejected = 0;
  for (size_t i = 0; i < report.residuals.size(); i += 5) {
    CornerResidual& corner = report.residuals[i];
    ++report.cameras[static_cast<size_t>(corner.camera_idx)].num_rejected, ++rejected;
    corner.rejected = true, corner.residual_px = {off_px, 0};
  }
  report.rejected_fraction = static_cast<double>(rejected) / static_cast<double>(report.residuals.size());
  report.verdict = Judge(report);
  return report;
}

TEST(Verdict, RejectedCornersCountFromThreeTenthsOfAPixelOn) {
  EXPECT_EQ(Said(WithRejected(0.1), "CAL-REJECTED"), "");
  EXPECT_NE(Said(WithRejected(2), "CAL-REJECTED"), "");
}

TEST(Verdict, WhatBoardsDidNotReachIsOneLineACamera) {
  CalibrateReport report = Calibrate(testing::ToInput(MakeRecording()), testing::PlainOptions(), {});
  ASSERT_EQ(Said(report, "CAL-UNCERTAIN"), "");
  const auto side_px = [&](double sigma_px, double need_px) {
    report.uncertainty.cameras[0].edge_px = sigma_px, report.need_px = need_px;
    report.verdict = Judge(report);
    return Said(report, "CAL-UNCERTAIN");
  };
  const double limit_px = PixelLimitsOf(report.rig.cameras[0].camera, 0).side_px;
  EXPECT_EQ(side_px(0.95 * limit_px, 0), "");
  EXPECT_NE(side_px(0.95 * limit_px, 0.5), "") << "a need of half a pixel";
  EXPECT_EQ(side_px(1.05 * limit_px, 5), "");
  report.cameras[0].coverage = 0.3, report.cameras[0].lens_beyond = "of the simpler lenses brown1 comes nearest";
  EXPECT_NE(side_px(1.05 * limit_px, 0).find("cover 30 %"), std::string::npos);
  EXPECT_EQ(Said(report, "CAL-LOWCOV"), "") << "said once";
  const auto& reasons = report.verdict.reasons;
  const auto line = std::find_if(reasons.begin(), reasons.end(), [](const auto& r) { return r.code == "CAL-UNCERTAIN"; });
  EXPECT_NE(line->hint.find("brown1 comes nearest"), std::string::npos) << line->hint;
}

TEST(Verdict, AFoldIsNamedByItsPlaces) {
  CalibrateReport report = Calibrate(testing::ToInput(MakeRecording()), testing::PlainOptions(), {});
  geometry::Camera folding = report.rig.cameras[0].camera;
  folding = WithModel(folding, geometry::LensModel::kBrown1, {});
  folding.params[4] = -0.9;
  report.cameras[0].folds = FindFolds(folding);
  std::swap(report.rig.cameras[0].camera, folding);
  report.verdict = Judge(report);
  const std::string text = Said(report, "CAL-FOLD");
  for (const char* part : {"top-left corner", "bottom-right corner", "from "})
    EXPECT_NE(text.find(part), std::string::npos) << text;
  EXPECT_EQ(text.find("middle"), std::string::npos) << text;
  EXPECT_EQ(text.find("inf"), std::string::npos) << text;
  report.cameras[0].folds = FindFolds(folding);
  EXPECT_EQ(report.cameras[0].folds.share, 0);
}

/// What `calib show` says of the rig: a fisheye that folds near its axis, and one whose circle ends within the image.
TEST(Verdict, AFoldIsSaidAsOfAnyFile) {
  CalibrateReport report = Calibrate(testing::ToInput(MakeRecording()), testing::PlainOptions(), {});
  geometry::Camera& lens = report.rig.cameras[0].camera;
  lens = WithModel(lens, geometry::LensModel::kKannalaBrandt4, {});
  lens.params.tail<4>().setZero();
  for (const double focal_px : {250.0, 330.0}) {
    for (const double k1 : {-0.6, -0.05, 0.0}) {
      lens.params[0] = lens.params[1] = focal_px, lens.params[4] = k1;
      report.cameras[0].model = lens.model, report.cameras[0].folds = FindFolds(lens);
      report.verdict = Judge(report);
      const auto shown = geometry::ConflictsIn(report.rig);
      const bool said =
          std::any_of(shown.begin(), shown.end(), [](const Notice& conflict) { return conflict.code == "CAL-FOLD"; });
      EXPECT_EQ(said, k1 == -0.6) << focal_px << " " << k1;
      EXPECT_EQ(!Said(report, "CAL-FOLD").empty(), said) << focal_px << " " << k1;
    }
  }
}

TEST(Verdict, WhereThereIsNoSolutionACameraOfFewBoardsIsNamed) {
  CalibrateInput input = testing::ToInput(MakeRecording());
  auto& all = input.detections;
  all.erase(std::remove_if(all.begin(), all.end(), [](const Detection& d) { return d.frame_idx > 1; }), all.end());
  const CalibrateReport report = Calibrate(input, testing::PlainOptions(), {});
  ASSERT_NE(report.status, Status::kOk);
  EXPECT_NE(report.message.find("only 1 board in view of cam"), std::string::npos) << report.message;
}

}  // namespace
}  // namespace mvstudio::calib
