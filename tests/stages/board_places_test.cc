#include "stages/calib/board_places.h"

#include <cmath>

#include "calib/board/sides.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Two cameras before the board and two behind it, which moves; each sees one side.
calib::CalibrateInput Studio(double thickness_m, uint64_t seed) {
  constexpr int kFrames = 24;
  calib::testing::Scene scene;
  scene.board = calib::ParseBoard("charuco:7x5:60mm:45mm:two-sided=0mm");
  scene.board.back_m = thickness_m;
  const double angles[] = {-0.35, 0.35, kPi - 0.35, kPi + 0.35};
  for (int c = 0; c < 4; ++c) {
    scene.truth.cameras.push_back(calib::testing::MakeCamera("cam" + std::to_string(c), geometry::LensModel::kPinhole, 620));
    const Eigen::Vector3d eye(1.1 * std::cos(angles[c]), 1.1 * std::sin(angles[c]), 0.15 * c);
    scene.truth.cam_from_world.push_back(calib::testing::LookAt(eye, Eigen::Vector3d::Zero()));
  }
  Eigen::Matrix3d facing;  // x to the viewer's right, y down, z away from the first two cameras
  facing << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  Rng rng(seed);
  for (int f = 0; f < kFrames; ++f) {
    geometry::Rigid3 pose;
    const Eigen::Vector3d turn(rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5), rng.Uniform(-0.4, 0.4));
    pose.rotation = geometry::RotationExp(turn) * Eigen::Quaterniond(facing);
    pose.translation << rng.Uniform(-0.15, 0.15), rng.Uniform(-0.12, 0.12), rng.Uniform(-0.1, 0.1);
    pose.translation -= pose.rotation * Eigen::Vector3d(0.15, 0.09, 0);
    scene.truth.frames.push_back(f);
    scene.truth.world_from_board.push_back(pose);
  }
  calib::CalibrateInput input = calib::testing::ToInput(scene);
  input.boards = {calib::ParseBoard("charuco:7x5:60mm:45mm:two-sided")};
  const int side = scene.board.num_side_corners();
  for (int c = 0; c < 4; ++c) {
    for (int f = 0; f < kFrames; ++f) {
      calib::Detection seen = calib::testing::Observe(scene, c, f, 0.1, &rng);
      if (seen.num_corners() != scene.board.num_corners()) continue;
      const int first = c < 2 ? 0 : side;
      seen.corner_ids = {seen.corner_ids.begin() + first, seen.corner_ids.begin() + first + side};
      seen.points_px = seen.points_px.middleCols(first, side).eval();
      input.detections.push_back(seen);
    }
  }
  return input;
}

TEST(BoardPlaces, ThicknessThatNobodyStated) {
  constexpr double kThickness = 0.004;
  double sum = 0;
  constexpr int kStudios = 4;
  for (int seed = 1; seed <= kStudios; ++seed) {
    calib::CalibrateInput input = Studio(kThickness, static_cast<uint64_t>(seed));
    const std::vector<int> front_of = calib::PartSides(&input);
    calib::CalibrateOptions options = calib::testing::PlainOptions();
    options.model = geometry::LensModel::kPinhole;
    const calib::CalibrateReport report = calib::Calibrate(input, options, {});
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    const PlacedBoards placed = {input.boards, report.rig_from_board, BehindSigmasMm(report, input.boards), front_of};
    const BoardPlace place = PlaceOf(input.boards[0], input.boards[1], report.rig_from_board[1]);
    const double sigma = placed.behind_sigmas_mm[1], error = place.behind_mm - 1e3 * kThickness;
    EXPECT_FALSE(place.opposite);
    EXPECT_GT(sigma, 1e-3);
    EXPECT_LT(sigma, 0.5);
    EXPECT_LT(std::abs(error), 4 * sigma) << "mm";
    sum += error * error / (sigma * sigma);
    EXPECT_THAT(BoardPlacesText(placed), HasSubstr("back of board charuco:7x5:60mm:45mm:4x4_1000: tilted by"));
    const auto json = BoardPlacesJson(placed);
    EXPECT_EQ(json[0]["back_of"], 0);
    EXPECT_EQ(json[0]["place"]["behind_sigma_mm"], sigma);
  }
  EXPECT_GT(std::sqrt(sum / kStudios), 0.2) << "a sigma that is much too large";
  EXPECT_LT(std::sqrt(sum / kStudios), 2.2);
}

TEST(BoardPlaces, ABoardThatNothingLinksIsSaid) {
  const std::vector<calib::Board> boards = {calib::ParseBoard("tag:4x4_50:0:60mm"), calib::ParseBoard("tag:4x4_50:1:60mm")};
  const PlacedBoards placed = {boards, {geometry::Rigid3(), geometry::Rigid3()}, {0, 0}, {-1, -1}};
  EXPECT_THAT(BoardPlacesText(placed), HasSubstr("tag:4x4_50:1:60mm: no frame shows it together"));
  EXPECT_TRUE(BoardPlacesJson(placed)[0]["place"].is_null());
  const std::vector<calib::Board> alike(3, calib::ParseBoard("grid:9x9:30mm"));
  const std::vector<geometry::Rigid3> nowhere(3);
  const std::string text = BoardPlacesText({alike, nowhere, {0, 0, 0}, {-1, -1, -1}});
  EXPECT_THAT(text, HasSubstr("board 1 grid:9x9:30mm: no frame")) << "each by its number";
  EXPECT_THAT(text, HasSubstr("board 2 grid:9x9:30mm: no frame"));
}

}  // namespace
}  // namespace mvstudio::stages
