#include <memory>

#include "calib/board/sides.h"
#include "calib/calibrate.h"
#include "calib/corners/corner_files.h"
#include "calib/detect/detect_footage.h"
#include "calib/pipeline/solvable.h"
#include "core/error.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Boards with prints on both sides, among cameras all around: two in front of the board, two behind it.
namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

Rigid3 Shift(double x, double y, double z) {
  Rigid3 shift;
  shift.translation << x, y, z;
  return shift;
}

/// A print and where it lies in the frame of the front.
struct Side {
  Board print;
  Rigid3 front_from_print;
};

/// Cameras at -20, 20, 160 and 200 degrees; the front faces the first two.
testing::Scene Studio(int num_frames) {
  testing::Scene scene;
  const double angles[] = {-0.35, 0.35, kPi - 0.35, kPi + 0.35};
  for (int c = 0; c < 4; ++c) {
    scene.truth.cameras.push_back(testing::MakeCamera("cam" + std::to_string(c), geometry::LensModel::kPinhole, 620));
    const Eigen::Vector3d eye(1.1 * std::cos(angles[c]), 1.1 * std::sin(angles[c]), 0.15 * c);
    scene.truth.cam_from_world.push_back(testing::LookAt(eye, Eigen::Vector3d::Zero()));
  }
  Eigen::Matrix3d facing;  // x to the viewer's right, y down, z away from the first two cameras
  facing << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  Rng rng(3);
  for (int f = 0; f < num_frames; ++f) {
    Rigid3 world_from_board;
    const Eigen::Vector3d turn(rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5), rng.Uniform(-0.4, 0.4));
    world_from_board.rotation = geometry::RotationExp(turn) * Eigen::Quaterniond(facing);
    world_from_board.translation << rng.Uniform(-0.15, 0.15), rng.Uniform(-0.12, 0.12), rng.Uniform(-0.1, 0.1);
    scene.truth.frames.push_back(f);
    scene.truth.world_from_board.push_back(world_from_board * Shift(-0.15, -0.09, 0));  // the middle of charuco:7x5:60mm
  }
  return scene;
}

/// What a camera sees: the print that faces it. From behind, `print` is drawn as in a mirror, as the back of a two-sided board
/// is.
Image DrawnImage(const testing::Scene& scene, int camera, int frame, const std::vector<Side>& front,
                 const std::vector<Side>& back) {
  const Rigid3 cam_from_front = scene.truth.cam_from_world[camera] * scene.truth.world_from_board[frame];
  const bool faces = (geometry::Inverse(cam_from_front).translation).z() < 0;
  const std::vector<Side>& sides = faces ? front : back;
  if (sides.empty()) return {640, 480, 1, 128};
  return RenderBoard(sides[0].print, scene.truth.cameras[camera], cam_from_front * sides[0].front_from_print, 3);
}

std::vector<FootageDetections> FilmBoards(const testing::Scene& scene, const std::vector<Board>& boards,
                                          const std::vector<Side>& front, const std::vector<Side>& back) {
  std::vector<Footage> footage;
  for (int c = 0; c < 4; ++c) {
    Footage camera;
    camera.camera = scene.truth.cameras[c].name, camera.path = "memory";
    auto next = std::make_shared<int>(0);
    camera.next = [=]() -> std::optional<FootageFrame> {
      const int f = (*next)++;
      if (f >= static_cast<int>(scene.truth.frames.size())) return std::nullopt;
      return FootageFrame{f, "frame " + std::to_string(f), DrawnImage(scene, c, f, front, back)};
    };
    footage.push_back(camera);
  }
  FootageOptions options;
  options.cache.kind = CachePlace::Kind::kOff;
  options.all_cameras = false;
  return DetectFootage(boards, footage, options, RunContext());
}

SolvableCalibration Solve(const std::vector<Board>& boards, const std::vector<FootageDetections>& found) {
  CalibrateOptions options = testing::PlainOptions();
  options.model = geometry::LensModel::kPinhole;
  return CalibrateSolvable(ToCalibrateInput(boards, found), options, RunContext());
}

TEST(TwoSidedBoard, TextAndCorners) {
  const Board board = ParseBoard("charuco:6x5:40mm:30mm:5x5_250:two-sided=3mm");
  EXPECT_EQ(ToString(board), "charuco:6x5:40mm:30mm:5x5_250:two-sided=3mm");
  EXPECT_EQ(ToString(FrontOf(board)), "charuco:6x5:40mm:30mm:5x5_250");
  ASSERT_EQ(board.num_corners(), 40);
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(corners.col(20 + i), corners.col(i) + Eigen::Vector3d(0, 0, 0.003));
  EXPECT_EQ(ToString(ParseBoard("aprilgrid:4x3:60mm:0.3:36h11:first=12:two-sided=0mm")),
            "aprilgrid:4x3:60mm:0.3:36h11:first=12:two-sided=0mm");
  const Board unknown = ParseBoard("charuco:6x5:40mm:30mm:two-sided");
  EXPECT_EQ(ToString(unknown), "charuco:6x5:40mm:30mm:4x4_1000:two-sided");
  EXPECT_EQ(unknown.num_corners(), 40);
  const std::string thickness = MessageOf<UsageError>([&] { RequireThickness({unknown}); });
  EXPECT_NE(thickness.find("how thick"), std::string::npos) << thickness;
  for (const char* wrong : {"charuco:6x5:40mm:30mm:two-sided=3", "charuco:6x5:40mm:30mm:two-sided=-1mm",
                            "chessboard:9x6:25mm:two-sided=3mm", "tag:36h11:1:60mm:two-sided=1mm"})
    EXPECT_THROW(ParseBoard(wrong), UsageError) << wrong;
}

TEST(TwoSidedBoard, AnUnknownBackIsABoardOfItsOwn) {
  CalibrateInput input;
  input.boards = {ParseBoard("charuco:6x5:40mm:30mm:5x5_250:first=20"), ParseBoard("charuco:6x5:40mm:30mm:two-sided"),
                  ParseBoard("charuco:6x5:40mm:30mm:6x6_50:two-sided=2mm")};
  for (const auto& [board, id] : {std::pair{0, 19}, {1, 19}, {1, 23}, {2, 23}}) {
    Detection seen;
    seen.board_idx = board, seen.corner_ids = {id}, seen.points_px = Eigen::Vector2d(id, board);
    input.detections.push_back(seen);
  }
  EXPECT_EQ(PartSides(&input), (std::vector<int>{-1, -1, -1, 1}));
  ASSERT_EQ(input.boards.size(), 4u);
  EXPECT_EQ(ToString(input.boards[3]), "charuco:6x5:40mm:30mm:4x4_1000");
  const auto is = [&](size_t i, int board, int id) {
    return input.detections[i].board_idx == board && input.detections[i].corner_ids[0] == id;
  };
  EXPECT_TRUE(is(0, 0, 19) && is(1, 1, 19) && is(2, 3, 3) && is(3, 2, 23));
}

TEST(TwoSidedBoard, MarkersBeginWhereTold) {
  const Board board = ParseBoard("charuco:6x5:40mm:30mm:4x4_50:first=20");
  EXPECT_EQ(ToString(board), "charuco:6x5:40mm:30mm:4x4_50:first=20");
  EXPECT_THROW(ParseBoard("charuco:6x5:40mm:30mm:4x4_50:first=36"), UsageError);  // 15 markers
  Rigid3 pose = Shift(-0.08, -0.06, 0.5);
  const Image image = RenderBoard(board, testing::MakeCamera("c", geometry::LensModel::kPinhole, 620), pose, 3);
  EXPECT_EQ(DetectBoard(board, image).detection.num_corners(), 20);
  EXPECT_NE(DetectBoard(ParseBoard("charuco:6x5:40mm:30mm:4x4_50"), image).status, Status::kOk);
}

TEST(TwoSidedBoard, MarksInCommonAreNamed) {
  const auto shared = [](const char* a, const char* b) { return SharedMarks(ParseBoard(a), ParseBoard(b)); };
  EXPECT_EQ(shared("charuco:6x5:40mm:30mm:4x4_50", "charuco:6x5:30mm:20mm:4x4_1000:first=10"), "markers 10 to 14 of 4x4");
  EXPECT_EQ(shared("charuco:6x5:40mm:30mm:4x4_50", "charuco:6x5:40mm:30mm:4x4_50:first=15"), "");
  EXPECT_EQ(shared("charuco:6x5:40mm:30mm:4x4_50", "charuco:6x5:40mm:30mm:5x5_50"), "");
  EXPECT_EQ(shared("aprilgrid:4x3:60mm:0.3", "tag:36h11:11:50mm"), "tags 11 to 11 of 36h11");
  EXPECT_EQ(shared("aprilgrid:4x3:60mm:0.3", "aprilgrid:4x3:60mm:0.3:first=12"), "");
  EXPECT_EQ(shared("chessboard:9x6:25mm", "chessboard:9x6:25mm"), "everything");
}

/// One print in a mirror on the back: both pairs of cameras are tied by every frame.
TEST(TwoSidedBoard, FromFootage) {
  const testing::Scene scene = Studio(10);
  const Board board = ParseBoard("charuco:7x5:60mm:45mm:two-sided=4mm");
  const auto found = FilmBoards(scene, {board}, {{FrontOf(board), {}}}, {{FrontOf(board), Shift(0, 0, 0.004)}});
  for (int c = 0; c < 4; ++c) {
    ASSERT_GT(found[c].detections.size(), 6u) << c;
    for (const Detection& d : found[c].detections) EXPECT_EQ(d.corner_ids[0] >= board.num_side_corners(), c >= 2);
  }
  const SolvableCalibration solved = Solve({board}, found);
  ASSERT_EQ(solved.report.status, Status::kOk) << solved.report.message;
  EXPECT_LT(solved.report.rms_px, 0.1);
  const auto off = geometry::CompareRigs(solved.report.rig, testing::TruthRig(scene));
  std::printf("two-sided: rms %.3f px, off by %.3f mm, %.4f deg\n", solved.report.rms_px, 1e3 * off.max_translation_m,
              off.max_rotation_rad * 180 / kPi);
  EXPECT_LT(off.max_translation_m, 1.5e-3);
  EXPECT_LT(off.max_rotation_rad, 1e-3);
}

TEST(TwoSidedBoard, CornersReadBackAndMirroredOnesAreTheBack) {
  const TempDir folder;
  const testing::Scene scene = Studio(4);
  CornerFile file;
  file.boards = {ParseBoard("charuco:7x5:60mm:45mm:two-sided=4mm")};
  testing::Scene seen = scene;
  seen.board = file.boards[0];
  for (const auto& camera : scene.truth.cameras) file.cameras.push_back({camera.name, 640, 480});
  Rng rng(1);
  const int side = seen.board.num_side_corners();
  for (int c = 0; c < 4; ++c) {
    for (int f = 0; f < 4; ++f) {
      Detection all = testing::Observe(seen, c, f, 0, &rng);
      Detection one = all;
      one.corner_ids.clear();
      std::vector<int> kept;
      for (int i = 0; i < all.num_corners(); ++i) {
        if ((all.corner_ids[i] >= side) == (c >= 2)) one.corner_ids.push_back(all.corner_ids[i]), kept.push_back(i);
      }
      one.points_px = all.points_px(Eigen::all, kept).eval();
      if (one.num_corners() > 8) file.detections.push_back(one);
    }
  }
  WriteCornerFile(file, folder / "sides.csv");
  const CornerFile same = ReadCornerFile(folder / "sides.csv");
  EXPECT_TRUE(same.notes.empty());
  ASSERT_EQ(same.detections.size(), file.detections.size());
  for (size_t i = 0; i < same.detections.size(); ++i) EXPECT_EQ(same.detections[i].corner_ids, file.detections[i].corner_ids);
  // Another program's numbers are those of the front, on both sides.
  CornerFile plain = file;
  for (Detection& d : plain.detections) {
    for (int& id : d.corner_ids) id %= side;
  }
  WriteCornerFile(plain, folder / "plain.csv");
  const CornerFile told = ReadCornerFile(folder / "plain.csv");
  ASSERT_EQ(told.detections.size(), file.detections.size());
  for (size_t i = 0; i < told.detections.size(); ++i) EXPECT_EQ(told.detections[i].corner_ids, file.detections[i].corner_ids);
}

/// Two prints glued onto a plate by hand: how they lie to each other comes from their motion.
TEST(TwoSidedBoard, TwoBoardsBackToBackFromFootage) {
  const testing::Scene scene = Studio(24);
  const std::vector<Board> boards = {ParseBoard("charuco:7x5:60mm:45mm:4x4_50"),
                                     ParseBoard("charuco:7x5:60mm:45mm:4x4_50:first=17")};
  Rigid3 front_from_back = Shift(0.303, 0.002, 0.006);  // turned about the board's vertical axis
  front_from_back.rotation =
      geometry::RotationExp(Eigen::Vector3d(0, 0, 0.03)) * geometry::RotationExp(Eigen::Vector3d(0, kPi, 0));
  const auto found = FilmBoards(scene, boards, {{boards[0], {}}}, {{boards[1], front_from_back}});
  const SolvableCalibration solved = Solve(boards, found);
  ASSERT_EQ(solved.report.status, Status::kOk) << solved.report.message;
  ASSERT_TRUE(solved.left_out.empty());
  const auto off = geometry::CompareRigs(solved.report.rig, testing::TruthRig(scene));
  const Rigid3 error = geometry::Inverse(front_from_back) * solved.report.rig_from_board[1];
  std::printf("two boards: rms %.3f px, rig off by %.3f mm, %.4f deg, boards by %.3f mm, %.4f deg\n", solved.report.rms_px,
              1e3 * off.max_translation_m, off.max_rotation_rad * 180 / kPi, 1e3 * error.translation.norm(),
              error.rotation.angularDistance(Eigen::Quaterniond::Identity()) * 180 / kPi);
  EXPECT_LT(off.max_translation_m, 2e-3);
  EXPECT_LT(off.max_rotation_rad, 1.5e-3);
  EXPECT_LT(error.translation.norm(), 1e-3);
}

TEST(TwoSidedBoard, APrintOnOneSideLeavesOutTheCamerasBehindIt) {
  const testing::Scene scene = Studio(8);
  const Board board = ParseBoard("charuco:7x5:60mm:45mm");
  const auto plain = FilmBoards(scene, {board}, {{board, {}}}, {});
  const SolvableCalibration solved = Solve({board}, plain);
  ASSERT_EQ(solved.left_out.size(), 2u);
  EXPECT_EQ(solved.left_out[0].name, "cam2");
  EXPECT_EQ(solved.report.rig.cameras.size(), 2u);
  // Printed through, and not said to be: named with what to say.
  const auto through = FilmBoards(scene, {board}, {{board, {}}}, {{board, Shift(0, 0, 0.002)}});
  EXPECT_NE(through[2].failure.find("two-sided=THICKNESS"), std::string::npos) << through[2].failure;
}

TEST(TwoSidedBoard, AFloorNeedsTheFront) {
  testing::Scene scene = Studio(6);
  scene.board = ParseBoard("charuco:7x5:60mm:45mm:two-sided=4mm");
  CalibrateInput input = testing::ToInput(scene);
  Rng rng(1);
  for (int f = 0; f < 6; ++f) {
    for (int c = 0; c < 2; ++c) {
      Detection d = testing::Observe(scene, c, f, 0.05, &rng);
      const int side = scene.board.num_side_corners();
      d.corner_ids.resize(static_cast<size_t>(side));
      d.points_px = d.points_px.leftCols(side).eval();
      for (int& id : d.corner_ids) id += f == 0 ? side : 0;
      input.detections.push_back(d);
    }
  }
  input.cameras.resize(2);
  CalibrateOptions options = testing::PlainOptions();
  options.model = geometry::LensModel::kPinhole;
  options.world.board_frame = 0;
  EXPECT_NE(Calibrate(input, options, {}).message.find("shows its back"), std::string::npos);
  options.world.board_frame = 1;
  EXPECT_EQ(Calibrate(input, options, {}).message.find("shows its back"), std::string::npos);
}

}  // namespace
}  // namespace mvstudio::calib
