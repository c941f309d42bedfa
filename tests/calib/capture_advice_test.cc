#include "calib/verdict/capture_advice.h"

#include <cmath>
#include <limits>

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::vector<geometry::Camera> Cameras(int count) {
  std::vector<geometry::Camera> cameras;
  for (int c = 0; c < count; ++c) cameras.push_back(geometry::MakePinhole("cam" + std::to_string(c), 1000, 800, 900));
  return cameras;
}

/// Corners in every cell of [col, col_end) x [row, row_end) of the 10 x 8 cells.
FilmedBoard Filmed(int camera, int64_t frame, int col, int col_end, int row, int row_end, const Eigen::Vector3d& turn,
                   double range_m) {
  FilmedBoard board{camera, frame, {}, geometry::Rigid3(), range_m};
  std::vector<Eigen::Vector2d> points;
  for (int r = row; r < row_end; ++r) {
    for (int c = col; c < col_end; ++c) points.push_back({100 * c + 50.0, 100 * r + 50.0});
  }
  board.px.resize(2, points.size());
  for (size_t i = 0; i < points.size(); ++i) board.px.col(i) = points[i];
  board.cam_from_board->rotation = geometry::RotationExp(turn);
  return board;
}

/// Ten boards that leave nothing to be wished.
std::vector<FilmedBoard> Good(int camera) {
  std::vector<FilmedBoard> boards;
  for (int f = 0; f < 10; ++f) {
    const double tilt = f % 2 ? 0.6 : -0.6;
    boards.push_back(
        Filmed(camera, f, 0, 10, 0, 8, f < 5 ? Eigen::Vector3d(tilt, 0, 0) : Eigen::Vector3d(0, tilt, 0), 1 + 0.1 * f));
  }
  return boards;
}

TEST(CaptureAdvice, SaysNothingWhenNothingIsMissing) {
  std::vector<FilmedBoard> boards = Good(0);
  for (const FilmedBoard& board : Good(1)) boards.push_back(board);
  EXPECT_TRUE(CaptureAdvice(Cameras(2), boards).empty());
}

TEST(CaptureAdvice, NamesTheEmptyPartOfTheImage) {
  std::vector<FilmedBoard> boards = Good(0);
  for (FilmedBoard& board : boards) {
    Eigen::Index n = 0;
    for (Eigen::Index i = 0; i < board.px.cols(); ++i) {
      if (!(board.px(0, i) > 700 && board.px(1, i) < 300)) board.px.col(n++) = board.px.col(i);
    }
    board.px.conservativeResize(2, n);
  }
  const auto hints = CaptureAdvice(Cameras(1), boards);
  ASSERT_EQ(hints.size(), 1u);
  EXPECT_EQ(hints[0].code, "FILM-COVERAGE");
  EXPECT_EQ(hints[0].camera_idx, 0);
  EXPECT_EQ(
      hints[0].text,
      "camera cam0: the top-right corner of the image holds no corners (9 of the image's 80 cells are empty there): show the "
      "board there, tilted about its vertical axis; the nearest board was 1 m away");
}

TEST(CaptureAdvice, CornersThatAreAllMissingAreOneWord) {
  std::vector<FilmedBoard> boards;
  for (const FilmedBoard& good : Good(0)) {
    boards.push_back(Filmed(0, good.frame_idx, 4, 6, 3, 5, Eigen::Vector3d::Zero(), good.range_m));
    boards.back().cam_from_board = good.cam_from_board;
  }
  const auto hints = CaptureAdvice(Cameras(1), boards);
  ASSERT_FALSE(hints.empty());
  EXPECT_EQ(hints[0].brief, "show the board at all four corners and all four sides of the image");
}

TEST(CaptureAdvice, AsksForTiltsAboutTheMissingAxisOnly) {
  std::vector<FilmedBoard> boards = Good(0);
  for (FilmedBoard& board : boards) board.cam_from_board->rotation = geometry::RotationExp({0.6, 0, 0});  // about image x
  auto hints = CaptureAdvice(Cameras(1), boards);
  ASSERT_EQ(hints.size(), 1u);
  EXPECT_EQ(hints[0].code, "FILM-TILT");
  EXPECT_THAT(hints[0].text, HasSubstr("0 of 10 boards are tilted by 15 degrees or more about the vertical axis"));
  EXPECT_THAT(hints[0].text, HasSubstr("to the left and to the right"));
  for (FilmedBoard& board : boards) board.cam_from_board->rotation = geometry::RotationExp({0, 0.1, 0});
  hints = CaptureAdvice(Cameras(1), boards);
  ASSERT_EQ(hints.size(), 2u);
  EXPECT_THAT(hints[0].text, HasSubstr("(the largest tilt is 6)"));
}

/// The back of a board faces the camera as well as its front.
TEST(CaptureAdvice, ABoardRotatedRoundIsNotTilted) {
  std::vector<FilmedBoard> boards = Good(0);
  for (FilmedBoard& board : boards) board.cam_from_board->rotation = geometry::RotationExp({M_PI, 0, 0});
  EXPECT_EQ(CaptureAdvice(Cameras(1), boards).size(), 2u);
}

TEST(CaptureAdvice, AsksForOtherDistancesAndMoreBoards) {
  std::vector<FilmedBoard> boards = Good(0);
  for (FilmedBoard& board : boards) board.range_m = 2;
  auto hints = CaptureAdvice(Cameras(1), boards);
  ASSERT_EQ(hints.size(), 1u);
  EXPECT_EQ(hints[0].code, "FILM-RANGE");
  EXPECT_THAT(hints[0].text, HasSubstr("2 m to 2 m"));
  boards = Good(0);
  boards.erase(boards.begin() + 3, boards.begin() + 6);
  hints = CaptureAdvice(Cameras(1), boards);
  ASSERT_EQ(hints.size(), 1u);
  EXPECT_EQ(hints[0].text, "camera cam0: 7 boards only: show 8 or more, in different places, distances and tilts");
}

/// cam1 shares all frames with cam0, cam2 two with cam1 and one with cam0, cam3 none.
TEST(CaptureAdvice, NamesTheWeakLinks) {
  std::vector<FilmedBoard> boards = Good(0);
  for (int camera : {1, 2, 3}) {
    for (FilmedBoard board : Good(camera)) {
      if (camera == 2) board.frame_idx += 8;
      if (camera == 3) board.frame_idx += 1000;
      boards.push_back(board);
    }
  }
  boards.erase(boards.begin() + 9);  // the last of cam0
  const auto hints = CaptureAdvice(Cameras(4), boards);
  ASSERT_EQ(hints.size(), 2u);
  EXPECT_THAT(hints[0].text, HasSubstr("cam3 see the board together in no frame"));
  EXPECT_THAT(hints[1].text, HasSubstr("cameras cam1 and cam2 see the board together in 2 frames"));
  EXPECT_TRUE(CaptureAdvice(Cameras(4), boards, false).empty());
}

TEST(FilmedBoards, OfTheSolutionAndOfTheReportAgree) {
  const testing::Scene scene = testing::MakeScene({});
  RigState state = scene.truth;
  std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  views[0].weights[3] = 0;
  const auto of_state = FilmedBoards(views, state);
  CalibrateReport report;
  report.rig = testing::TruthRig(scene);
  for (size_t c = 0; c < 2; ++c) report.rig.cameras[c].cam_from_world = state.cam_from_world[c];
  report.frames = state.frames, report.world_from_board = state.world_from_board;
  for (const View& view : views) {
    for (Eigen::Index i = 0; i < view.size(); ++i)
      report.residuals.push_back({view.camera_idx, state.frames[view.frame], view.corner_ids[i], view.px.col(i),
                                  Eigen::Vector2d(0, 0), view.weights[i] <= 0});
  }
  const auto of_report = FilmedBoards(report);
  ASSERT_EQ(of_state.size(), of_report.size());
  for (size_t i = 0; i < of_state.size(); ++i) {
    EXPECT_EQ(of_state[i].camera_idx, of_report[i].camera_idx);
    EXPECT_EQ(of_state[i].px, of_report[i].px);
    EXPECT_LT((ToMatrix(*of_state[i].cam_from_board) - ToMatrix(*of_report[i].cam_from_board)).norm(), 1e-12);
    EXPECT_NEAR(of_state[i].range_m, of_report[i].range_m, 0.35);
  }
}

/// A report that passes.
CalibrateReport GoodReport() {
  CalibrateReport report;
  report.rms_px = 0.2, report.sigma_px = 0.14, report.num_corners = 5000, report.num_frames = 40;
  report.rig_holdout_rms_px = std::numeric_limits<double>::quiet_NaN();
  for (const char* name : {"a", "b"}) {
    CameraReport camera;
    camera.name = name, camera.num_views = camera.num_places = 40, camera.focal_px = 1000, camera.focal_sigma_px = 1,
    camera.rms_px = 0.2;
    camera.holdout_rms_px = 0.22, camera.coverage = 0.8;
    camera.num_corners = 2500, camera.alone_rms_px = 0.19;
    report.cameras.push_back(camera);
    report.uncertainty.cameras.push_back({name, 2, 0.02, 0.1, 0.3});
  }
  report.uncertainty.volume_mm = 0.3;
  return report;
}

std::string OutcomeText(const CalibrateReport& report) {
  const Verdict verdict = Judge(report);
  std::string text(ToString(verdict.outcome()));
  for (const auto& reason : verdict.reasons) {
    text += " " + reason.code;
    EXPECT_FALSE(reason.hint.empty()) << reason.code;
    EXPECT_FALSE(reason.text.empty()) << reason.code;
  }
  return text;
}

TEST(Judge, EveryLimitOnBothSides) {
  EXPECT_EQ(OutcomeText(GoodReport()), "pass");
  const auto changed = [](auto change) {
    CalibrateReport report = GoodReport();
    change(report);
    return OutcomeText(report);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(changed([](auto& r) { r.cameras[1].holdout_gross_fraction = 0.0049; }), "pass");
  EXPECT_EQ(changed([](auto& r) { r.cameras[1].holdout_gross_fraction = 0.006; }), "warn CAL-GROSS");
  EXPECT_EQ(changed([](auto& r) { r.cameras[1].holdout_gross_fraction = 0.06; }), "fail CAL-GROSS");
  EXPECT_EQ(changed([](auto& r) { r.uncertainty.cameras[0].edge_px = 0.9; }), "pass");
  EXPECT_EQ(changed([](auto& r) { r.uncertainty.cameras[0].edge_px = 1.1; }), "warn CAL-UNCERTAIN");
  EXPECT_EQ(changed([](auto& r) { r.uncertainty.cameras[0].edge_px = 5.1; }), "fail CAL-UNCERTAIN");
  EXPECT_EQ(changed([](auto& r) { r.uncertainty.cameras[0].corner_px = 4.9; }), "pass");
  EXPECT_EQ(changed([](auto& r) { r.uncertainty.cameras[0].corner_px = 50; }), "warn CAL-UNCERTAIN");
  EXPECT_EQ(changed([&](auto& r) { r.uncertainty.cameras[0].corner_px = nan; }), "pass");
  EXPECT_EQ(changed([](auto& r) { r.uncertainty.volume_mm = 3.9; }), "pass");
  EXPECT_EQ(changed([](auto& r) { r.uncertainty.volume_mm = 4.1; }), "warn CAL-VOLUME");
  EXPECT_EQ(changed([](auto& r) { r.uncertainty.volume_mm = 41; }), "fail CAL-VOLUME");
  EXPECT_EQ(changed([](auto& r) { r.frames_conflict = "frames drift"; }), "warn CAL-FRAMES");
  EXPECT_EQ(changed([](auto& r) { r.rig_holdout_rms_px = 1.2; }), "warn CAL-RIGHOLDOUT");
  EXPECT_EQ(changed([](auto& r) { r.rig_holdout_rms_px = 3.2; }), "fail CAL-RIGHOLDOUT");
  EXPECT_EQ(changed([](auto& r) { r.cameras[0].focal_sigma_px = 11; }), "warn CAL-FOCAL");
  EXPECT_EQ(changed([](auto& r) { r.cameras[0].coverage = 0.3; }), "warn CAL-LOWCOV");
}

TEST(Judge, NothingThatEndedBadlyPasses) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Status status : {Status::kTooFewViews, Status::kDegenerate, Status::kBehindCamera, Status::kNotConverged,
                              Status::kNonFiniteInput, Status::kLowParallax, Status::kUndefined}) {
    CalibrateReport report = GoodReport();
    report.status = status;
    EXPECT_EQ(OutcomeText(report), "fail CAL-UNSOLVED") << ToString(status);
    report.message = "focal length and distance cannot be separated";
    EXPECT_EQ(Judge(report).reasons.at(0).text, report.message);
  }
  for (int which = 0; which < 4; ++which) {
    CalibrateReport report = GoodReport();
    (which == 0   ? report.rms_px
     : which == 1 ? report.cameras[1].rms_px
     : which == 2 ? report.cameras[0].focal_sigma_px
                  : report.sigma_px) = nan;
    EXPECT_EQ(Judge(report).outcome(), Outcome::kFail) << which;
  }
  CalibrateReport empty;
  EXPECT_EQ(Judge(empty).outcome(), Outcome::kFail);
}

}  // namespace
}  // namespace mvstudio::calib
