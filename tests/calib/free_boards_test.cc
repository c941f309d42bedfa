#include "calib/rig/free_boards.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "calib/calibrate.h"
#include "tests/calib/synthetic.h"

namespace mvstudio::calib {
namespace {

using testing::Scene;

/// Two boards in every frame: the second lies where the first lies in the frame that `of` names, but for `away`.
CalibrateInput TwoBoards(const std::function<int(int)>& of, const geometry::Rigid3& away) {
  testing::SceneOptions options;
  options.num_cameras = 3, options.num_frames = 14, options.noise_px = 0.2, options.model = geometry::LensModel::kBrown2;
  const Scene scene = testing::MakeScene(options);
  CalibrateInput input = testing::ToInput(scene);
  input.boards.push_back(scene.board);
  Scene second = scene;
  Rng rng(3);
  for (int f = 0; f < options.num_frames; ++f) {
    second.truth.world_from_board[f] = scene.truth.world_from_board[of(f)] * away;
    for (int c = 0; c < options.num_cameras; ++c) {
      Detection seen = testing::Observe(second, c, f, options.noise_px, &rng);
      seen.board_idx = 1;
      if (seen.num_corners() > 3) input.detections.push_back(seen);
    }
  }
  return input;
}

bool Said(const CalibrateReport& report, const std::string& code) {
  const auto& reasons = report.verdict.reasons;
  return std::any_of(reasons.begin(), reasons.end(), [&](const auto& reason) { return reason.code == code; });
}

TEST(FreeBoards, BoardsThatMoveAgainstEachOtherAreSolvedAndNamed) {
  const CalibrateInput input = TwoBoards([](int f) { return 13 - f; }, {});
  const CalibrateReport report = Calibrate(input, testing::PlainOptions(), {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_TRUE(report.free_boards);
  EXPECT_LT(report.rms_px, 0.4);
  EXPECT_TRUE(Said(report, "CAL-BOARDS"));
  EXPECT_NE(report.boards_moved.find("board 1 moved against board 0 by"), std::string::npos) << report.boards_moved;
  for (const char* code : {"CAL-MOVED", "CAL-LENSCHANGED", "CAL-CONTRADICTS"}) EXPECT_FALSE(Said(report, code)) << code;
  EXPECT_EQ(report.num_frames, 14);
  CalibrateOptions rigid = testing::PlainOptions();
  rigid.free_boards = AutoOnOff::kOff;
  const CalibrateReport forced = Calibrate(input, rigid, {});
  EXPECT_FALSE(forced.free_boards);
  EXPECT_NE(forced.verdict.status, "pass");
}

TEST(FreeBoards, RigidBoardsStayRigid) {
  geometry::Rigid3 beside;
  beside.translation = Eigen::Vector3d(0.05, 0.03, 0.02);
  const CalibrateReport report = Calibrate(TwoBoards([](int f) { return f; }, beside), testing::PlainOptions(), {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_FALSE(report.free_boards);
  EXPECT_TRUE(report.boards_moved.empty());
  EXPECT_LT((report.rig_from_board[1].translation - beside.translation).norm(), 2e-3);
}

}  // namespace
}  // namespace mvstudio::calib
