#include <cstdlib>
#include <filesystem>

#include "calib/calibrate.h"
#include "calib/detect/detect_footage.h"
#include "dataset/footage/frames.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::string DataFolder() {
  if (const char* data = std::getenv("MVSTUDIO_DATA")) return std::string(data) + "/opencv_stereo";
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  return std::string(source ? source : ".") + "/../shared/data/opencv_stereo";
}

Footage Open(const std::string& name) {
  const std::shared_ptr<dataset::FrameSource> source = dataset::OpenFrames(DataFolder() + "/" + name + "*.jpg");
  Footage footage;
  footage.camera = name, footage.path = source->path(), footage.num_frames = source->num_frames();
  footage.next = [source]() -> std::optional<FootageFrame> {
    auto frame = source->Next();
    if (!frame) return std::nullopt;
    const std::string digits = frame->label.substr(frame->label.size() - 6, 2);  // left01.jpg
    return FootageFrame{std::stoi(digits), frame->label, std::move(frame->rgb)};
  };
  return footage;
}

TEST(OpencvStereo, BeatsTheKnownFigures) {
  if (!std::filesystem::exists(DataFolder())) GTEST_SKIP() << "data set opencv_stereo is not there";
  const Board board = ParseBoard("chessboard:9x6:25mm");
  std::vector<Footage> footage;
  footage.push_back(Open("left"));
  footage.push_back(Open("right"));
  const auto found = DetectFootage(board, footage, FootageOptions(), RunContext());
  EXPECT_EQ(found[0].detections.size(), 13u);
  EXPECT_EQ(found[1].detections.size(), 13u);
  const CalibrateReport report =
      Calibrate(ToCalibrateInput(std::vector<Board>{board}, found), CalibrateOptions(), RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LE(report.rms_px, 0.186);
  EXPECT_LE(report.rejected_fraction, 0.024);
  EXPECT_LE(report.cameras[0].holdout_rms_px, 0.264);
  EXPECT_LE(report.cameras[1].holdout_rms_px, 0.256);
  EXPECT_LE(report.cameras[0].num_params, 8);
  const double baseline_m = (report.rig.cameras[0].CenterInWorld() - report.rig.cameras[1].CenterInWorld()).norm();
  EXPECT_GT(baseline_m, 0.0828);
  EXPECT_LT(baseline_m, 0.0833);
  for (const CameraReport& camera : report.cameras) EXPECT_EQ(camera.time_offset_frames, 0) << report.time_reason;
  EXPECT_EQ(report.verdict.outcome(), Outcome::kPass);
}

TEST(OpencvStereo, WrongBoardIsNeverSeen) {
  if (!std::filesystem::exists(DataFolder())) GTEST_SKIP() << "data set opencv_stereo is not there";
  std::vector<Footage> footage;
  footage.push_back(Open("left"));
  FootageOptions options;
  options.max_frames = 3;
  try {
    DetectFootage(ParseBoard("charuco:7x5:40mm:30mm"), footage, options, RunContext());
    FAIL();
  } catch (const FormatError& e) {
    EXPECT_NE(std::string(e.what()).find("camera left"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find("legacy"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace mvstudio::calib
