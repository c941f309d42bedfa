#include "stages/calib/board_views.h"

#include "core/disk/files.h"
#include "dataset/footage/image_io.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

/// Adds a view of `count` corners whose residuals (projected minus observed) are (error_px, 0).
void AddView(int camera, int64_t frame, int count, double error_px, calib::CalibrateReport* report) {
  for (int i = 0; i < count; ++i) {
    calib::CornerResidual corner;
    corner.camera_idx = camera, corner.frame_idx = frame, corner.corner_id = i;
    corner.px = {10.0 * i, 20}, corner.residual_px = {error_px, 0};
    report->residuals.push_back(corner);
  }
}

calib::CalibrateReport ReportOf(int num_cameras) {
  calib::CalibrateReport report;
  report.rig = triangulate::MakeRing(num_cameras);
  for (const auto& camera : report.rig.cameras) {
    report.cameras.emplace_back();
    report.cameras.back().name = camera.camera.name;
  }
  return report;
}

int64_t Same(int /*camera*/, int64_t frame_idx) { return frame_idx; }

TEST(BoardViews, AnOrdinaryViewAndTheWorstOfManyCorners) {
  calib::CalibrateReport report = ReportOf(2);
  AddView(0, 1, 40, 0.1, &report);
  AddView(0, 2, 38, 0.2, &report);
  AddView(0, 3, 31, 0.3, &report);
  AddView(0, 4, 21, 0.9, &report);  // more than half of the most
  AddView(0, 5, 10, 5.0, &report);  // few: an edge of the board
  AddView(1, 8, 12, 0.4, &report);
  const auto views = ChooseBoardViews(report, Same);
  ASSERT_EQ(views.size(), 3u);
  EXPECT_EQ(views[0].frame, 2);
  EXPECT_FALSE(views[0].worst);
  EXPECT_NEAR(views[0].rms_px, 0.2, 1e-12);
  EXPECT_EQ(views[1].frame, 4);
  EXPECT_TRUE(views[1].worst);
  EXPECT_EQ(views[2].camera_idx, 1);
}

TEST(BoardViews, RejectedCornersAreShownAndDoNotCount) {
  calib::CalibrateReport report = ReportOf(1);
  AddView(0, 1, 4, 0.5, &report);
  report.residuals[0].rejected = true, report.residuals[0].residual_px = {80, 0};
  const auto views = ChooseBoardViews(report, Same);
  ASSERT_EQ(views.size(), 1u);
  EXPECT_NEAR(views[0].rms_px, 0.5, 1e-12);
  const auto json = BoardViewsJson(report, views, {""});
  EXPECT_EQ(json[0]["picture"], nullptr);
  EXPECT_EQ(json[0]["corners"].size(), 4u);
  EXPECT_EQ(json[0]["corners"][0], nlohmann::ordered_json({0.0, 20.0, -80.0, 0.0, 1})) << "observed minus projected";
  for (calib::CornerResidual& corner : report.residuals) corner.rejected = true;
  EXPECT_TRUE(ChooseBoardViews(report, Same).empty());
}

TEST(BoardViews, FramesThatAreNotAtHandAreNotChosen) {
  calib::CalibrateReport report = ReportOf(1);
  AddView(0, 1, 40, 0.1, &report);
  AddView(0, 7, 20, 0.2, &report);
  const auto views = ChooseBoardViews(report, [](int, int64_t frame) { return frame == 1 ? -1 : frame + 100; });
  ASSERT_EQ(views.size(), 1u);
  EXPECT_EQ(views[0].frame, 107);
}

/// Grey images whose left half is brighter the higher their number.
void WriteFootage(const std::string& folder) {
  for (int number = 0; number < 4; ++number) {
    Image image(64, 48, 1, 0);
    for (int y = 0; y < 48; ++y) std::fill(image.Pixel(0, y), image.Pixel(32, y), static_cast<uint8_t>(60 * number));
    dataset::WriteImage(image, folder + "/f" + std::to_string(number) + ".png");
  }
}

TEST(BoardViews, ImagesOfTheShiftedFramesFlippedWhereTheCameraIs) {
  TempDir folder;
  WriteFootage(folder / "a");
  calib::CalibrateReport report = ReportOf(1);
  report.rig.cameras[0].camera = geometry::MakePinhole("cam_0", 64, 48, 100);
  report.frame_shift = {10};
  AddView(0, 12, 40, 0.1, &report);  // frame 2 of the footage
  CornerArguments arguments;
  arguments.cameras = {{"unused", folder / "b"}, {"cam_0", folder / "a"}};
  arguments.mirrored = {"cam_0"};
  const auto written = [&] { return DescribeBoardViews(report, WriteBoardViews(arguments, report, {1}, folder / "out", {})); };
  const CommandResult result = written();
  ASSERT_EQ(result.outputs.size(), 1u);
  EXPECT_EQ(result.metrics["board_views"][0]["frame"], 2);
  EXPECT_EQ(result.metrics["board_views"][0]["picture"], result.outputs[0].path);
  const Image image = dataset::ReadImage(result.outputs[0].path, true);
  EXPECT_EQ(result.metrics["board_views"][0]["box_px"].dump(), "[0,0,64,40]") << "around the corners inside the image";
  EXPECT_NEAR(*image.Pixel(60, 20), 120, 4);
  EXPECT_NEAR(*image.Pixel(4, 20), 0, 4);

  std::filesystem::remove_all(folder / "a");
  const CommandResult again = written();
  EXPECT_TRUE(again.outputs.empty());
  EXPECT_EQ(again.metrics["board_views"][0]["picture"], nullptr);
  EXPECT_EQ(again.metrics["board_views"][0]["corners"].size(), 40u);
}

TEST(BoardViews, CornersOfAFileHaveNoImages) {
  TempDir folder;
  calib::CalibrateReport report = ReportOf(2);
  AddView(1, 5, 9, 0.1, &report);
  const CommandResult result = DescribeBoardViews(report, WriteBoardViews({}, report, {0, 1}, folder / "out", {}));
  EXPECT_TRUE(result.outputs.empty());
  EXPECT_EQ(result.metrics["board_views"][0]["camera"], "cam_1");
}

}  // namespace
}  // namespace mvstudio::stages
