#include <gtest/gtest.h>

#include <algorithm>

#include "tests/calib/synthetic.h"

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
  for (const Verdict::Reason& reason : report.verdict.reasons)
    if (reason.code == code) return reason.text;
  return "";
}

TEST(Verdict, CornersBeyondTheToldSizeAreSaid) {
  CalibrateInput input = testing::ToInput(MakeRecording());
  EXPECT_EQ(Said(Calibrate(input, testing::PlainOptions(), {}), "CAL-SIZE"), "");
  input.cameras[1].width_px = 320, input.cameras[1].height_px = 240;
  const CalibrateReport report = Calibrate(input, testing::PlainOptions(), {});
  EXPECT_NE(Said(report, "CAL-SIZE").find("cam1"), std::string::npos);
  EXPECT_NE(report.verdict.status, "pass");
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
  EXPECT_NE(said(-0.4, 0.3, camera.num_corners), "");
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
