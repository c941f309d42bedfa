#include "stages/calib/board_poses.h"

#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

void See(int camera, int64_t frame, int board, bool rejected, calib::CalibrateReport* report) {
  calib::CornerResidual corner;
  corner.camera_idx = camera, corner.frame_idx = frame, corner.board_idx = board, corner.rejected = rejected;
  corner.residual_px = {0.3, 0.4};
  report->residuals.push_back(corner);
}

calib::CalibrateReport Report() {
  calib::CalibrateReport report;
  report.components = {{0, 1}};
  report.frames = {3, 8};
  report.world_from_board = {{Eigen::Quaterniond::Identity(), {1, 2, 3}}, {Eigen::Quaterniond::Identity(), {4, 5, 6}}};
  report.rig_from_board = {geometry::Rigid3(), {Eigen::Quaterniond::Identity(), {0, 0, 0.5}}};
  See(0, 3, 0, false, &report), See(1, 3, 0, false, &report), See(0, 8, 1, false, &report);
  See(1, 8, 0, true, &report);
  return report;
}

TEST(BoardPoses, EveryBoardThatWasSeen) {
  const std::string csv = BoardPosesCsv(Report());
  EXPECT_EQ(csv,
            "frame,board,x_m,y_m,z_m,qx,qy,qz,qw,num_cameras,num_corners,rms_px\n"
            "3,0,1,2,3,0,0,0,1,2,2,0.5000\n"
            "8,1,4,5,6.5,0,0,0,1,1,1,0.5000\n");
}

TEST(BoardPoses, BoardsOfTheirOwnStandBoardByBoard) {
  calib::CalibrateReport report = Report();
  report.free_boards = true, report.residuals.clear();
  report.frames = {8, 3};  // board 0 in frame 8, board 1 in frame 3
  See(0, 8, 0, false, &report), See(0, 3, 1, false, &report);
  const std::string csv = BoardPosesCsv(report);
  EXPECT_THAT(csv, HasSubstr("\n3,1,4,5,6,"));
  EXPECT_THAT(csv, HasSubstr("\n8,0,1,2,3,"));
}

TEST(BoardPoses, LensesAloneHaveNone) {
  calib::CalibrateReport report = Report();
  report.components.clear();
  EXPECT_EQ(BoardPosesCsv(report), "");
}

}  // namespace
}  // namespace mvstudio::stages
