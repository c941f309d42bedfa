#include "calib/rig/free_boards.h"

#include <algorithm>
#include <functional>

#include "calib/board/sets.h"
#include "calib/calibrate.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

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

TEST(FreeBoards, BoardsThatMoveAgainstEachOtherAreSolvedAndNamed) {
  const CalibrateInput input = TwoBoards([](int f) { return 13 - f; }, {});
  const CalibrateReport report = Calibrate(input, testing::PlainOptions(), {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_TRUE(report.free_boards);
  EXPECT_LT(report.rms_px, 0.4);
  EXPECT_TRUE(HasReason(report, "CAL-BOARDS"));
  EXPECT_NE(report.boards_moved.find("board 1 moved against board 0 by"), std::string::npos) << report.boards_moved;
  for (const char* code : {"CAL-MOVED", "CAL-LENSCHANGED", "CAL-CONTRADICTS"}) EXPECT_FALSE(HasReason(report, code)) << code;
  EXPECT_EQ(report.num_frames, 14);
  CalibrateOptions rigid = testing::PlainOptions();
  rigid.free_boards = AutoOnOff::kOff;
  const CalibrateReport forced = Calibrate(input, rigid, {});
  EXPECT_FALSE(forced.free_boards);
  EXPECT_NE(forced.verdict.outcome(), Outcome::kPass);
}

/// What a marker's place is to be, apart from the first.
geometry::Rigid3 PlaceOnBody(size_t marker, Rng* rng) {
  geometry::Rigid3 place;
  if (marker == 0) return place;
  place.translation << 0.15 * static_cast<double>(marker % 3), 0.16 * static_cast<double>(marker / 3),
      rng->Uniform(-0.05, 0.05);
  place.rotation =
      geometry::RotationExp(Eigen::Vector3d(rng->Uniform(-0.3, 0.3), rng->Uniform(-0.3, 0.3), rng->Uniform(-3, 3)));
  return place;
}

/// Markers glued onto a body, of which nobody measured more than the side.
TEST(FreeBoards, MarkersOfOneBodyFindTheirPlaces) {
  testing::SceneOptions options;
  options.num_cameras = 3, options.num_frames = 20, options.model = geometry::LensModel::kPinhole;
  Scene scene = testing::MakeScene(options);
  CalibrateInput input = testing::ToInput(scene);
  input.boards = SingleBoards({ParseBoard("tag:4x4_50:0-5:120mm")});
  std::vector<geometry::Rigid3> places;
  Rng rng(3);
  scene.board.kind = Board::Kind::kPoints;
  scene.board.points.resize(3, 4 * static_cast<Eigen::Index>(input.boards.size()));
  for (size_t b = 0; b < input.boards.size(); ++b) {
    places.push_back(PlaceOnBody(b, &rng));
    for (int k = 0; k < 4; ++k)
      scene.board.points.col(4 * static_cast<Eigen::Index>(b) + k) =
          places[b] * Eigen::Vector3d(CornersInBoard(input.boards[b]).col(k));
  }
  testing::ObserveAll(&scene, 0.05, 5);
  input.detections.clear();
  for (const Detection& seen : scene.detections) {
    for (size_t b = 0; b < input.boards.size(); ++b) {
      Detection marker = seen;
      marker.board_idx = static_cast<int>(b), marker.corner_ids.clear();
      std::vector<int> kept;
      for (int i = 0; i < seen.num_corners(); ++i) {
        const int id = seen.corner_ids[static_cast<size_t>(i)];
        if (id / 4 == marker.board_idx) marker.corner_ids.push_back(id % 4), kept.push_back(i);
      }
      marker.points_px = seen.points_px(Eigen::all, kept).eval();
      if (marker.num_corners() == 4) input.detections.push_back(marker);
    }
  }
  CalibrateOptions plain = testing::PlainOptions();
  plain.model = geometry::LensModel::kPinhole;
  const CalibrateReport report = Calibrate(input, plain, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_FALSE(report.free_boards);
  for (size_t b = 1; b < places.size(); ++b) {
    const geometry::Rigid3 error = geometry::Inverse(places[b]) * report.rig_from_board[b];
    EXPECT_LT(error.translation.norm(), 1e-3) << b;
    EXPECT_LT(error.rotation.angularDistance(Eigen::Quaterniond::Identity()), 0.01) << b;
  }
  EXPECT_LT(geometry::CompareRigs(report.rig, testing::TruthRig(scene)).max_translation_m, 3e-3);
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
