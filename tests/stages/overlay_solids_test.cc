#include <cmath>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/overlay/draw_solids.h"
#include "stages/overlay/draw_view.h"
#include "stages/overlay/run.h"
#include "stages/view/outline.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Bodies and boards over footage, where numbers written out here put them.
namespace mvstudio::stages {
namespace {

template <class T>
void Add(const std::vector<T>& values, std::string* out) {
  out->append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// A triangle between (0, 0, 0) and (2, 4, 0) of two bones at frames 10, 12 and 20: the first stands still at x = 1, the second
/// turned by a quarter about z.
std::string TwoBones() {
  std::string bytes = "MVBODY01";
  Add<uint32_t>({3, 1, 2, 3}, &bytes);
  Add<float>({0, 0, 0, 2, 4, 0}, &bytes);
  Add<int32_t>({10, 12, 20}, &bytes);
  Add<uint32_t>({0, 1, 2}, &bytes);
  for (int frame = 0; frame < 3; ++frame) Add<float>({1, 0, 0, 0, 0, static_cast<float>(frame)}, &bytes);
  const auto half = static_cast<int16_t>(std::lround(32767 * std::sqrt(0.5)));
  for (int frame = 0; frame < 3; ++frame) Add<int16_t>({0, 0, 0, 32767, 0, 0, half, half}, &bytes);
  Add<uint16_t>({0, 0, 0, 65535, 0, 0, 0, 65535, 0}, &bytes);
  Add<uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, &bytes);
  Add<uint8_t>({255, 0, 0, 0, 200, 0, 0, 0, 100, 100, 0, 0}, &bytes);
  return bytes;
}

TEST(MovingBody, IsPosedByTheWeightedTransformsOfItsBones) {
  const TempDir folder;
  WriteFileAtomic(folder / "b.bin", TwoBones());
  const MovingBody body = ReadMovingBody(folder / "b.bin");
  const auto at = BodyAt(body, 20);
  ASSERT_TRUE(at.has_value());
  Eigen::Matrix3d expected;  // columns: bone 0; bone 1 of (2, 0, 0); half of each of (0, 4, 0)
  expected << 1, 0, 0.5 * 1 - 0.5 * 4, 0, 2, 0.5 * 4, 0, 2, 0.5 * 2;
  EXPECT_LT((*at - expected).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(MovingBody, IsThereBetweenItsFramesAlone) {
  const TempDir folder;
  WriteFileAtomic(folder / "b.bin", TwoBones());
  const MovingBody body = ReadMovingBody(folder / "b.bin");
  for (const int frame : {9, 21, -1}) EXPECT_FALSE(BodyAt(body, frame).has_value()) << frame;
  EXPECT_EQ((*BodyAt(body, 11))(2, 1), 1) << "as far from both: the later";
  EXPECT_TRUE(BodyAt(body, 15).has_value()) << "a gap of the usual distance";
}

TEST(MovingBody, WhatWasCutOrChangedIsRefused) {
  const TempDir folder;
  const std::string good = TwoBones();
  for (size_t size = 0; size < good.size(); ++size) {
    WriteFileAtomic(folder / "b.bin", good.substr(0, size));
    EXPECT_THROW(ReadMovingBody(folder / "b.bin"), FormatError) << size;
  }
  std::string other = good;
  other[60] = 9;  // a face's first vertex, behind 48 bytes of header and 12 of frames
  WriteFileAtomic(folder / "b.bin", other);
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMovingBody(folder / "b.bin"); }), HasSubstr("does not have"));
}

TEST(TriangleMask, HoldsThePixelsWhoseCentresLieInside) {
  Eigen::Matrix2Xd px(2, 4);
  px << 0, 4, 0, NAN, 0, 0, 4, 1;
  Eigen::Matrix3Xi faces(3, 2);
  faces << 0, 0, 1, 1, 2, 3;
  const Image mask = TriangleMask(px, faces, 6, 6);
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 6; ++x) EXPECT_EQ(*mask.Pixel(x, y), x + y <= 4 ? 255 : 0) << x << ' ' << y;
}

constexpr char kPoses[] =
    "frame,board,x_m,y_m,z_m,qx,qy,qz,qw,num_cameras,num_corners,rms_px\n"
    "7,0,0.1,0.2,2,0,0,0,1,2,24,0.2\n7,1,0,0,3,0,0,0,1,2,24,0.2\n9,0,0,0,2,0,0,0.7071067811865476,0.7071067811865476,2,24,0."
    "2\n";

TEST(PlacedBoards, StandWhereTheCalibrationPutThem) {
  const TempDir folder;
  WriteFileAtomic(folder / "p.csv", kPoses);
  const auto boards = ReadPlacedBoards(folder / "p.csv", "chessboard:6x4:100mm");
  ASSERT_EQ(boards.size(), 2u);
  ASSERT_EQ(boards.at(7).size(), 1u) << "of a second board nothing is known";
  const PlacedBoard& straight = boards.at(7)[0];
  EXPECT_EQ(straight.corners.cols(), 24);
  EXPECT_LT((straight.outline.col(2) - Eigen::Vector3d(0.6, 0.5, 2)).norm(), 1e-12) << "five cells by three";
  EXPECT_LT((boards.at(9)[0].outline.col(1) - Eigen::Vector3d(0, 0.5, 2)).norm(), 1e-12) << "a quarter turn about z";
  WriteFileAtomic(folder / "p.csv", "frame,board,x_m,y_m,z_m,qx,qy,qz,qw\n7,0,0.1,x,2,0,0,0,1\n");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadPlacedBoards(folder / "p.csv", "chessboard:6x4:100mm"); }),
              HasSubstr("`x` is no number"));
}

geometry::RigCamera Pinhole() {
  geometry::RigCamera camera;
  camera.camera.model = geometry::LensModel::kPinhole;
  camera.camera.width_px = 200, camera.camera.height_px = 100;
  camera.camera.params = Eigen::Vector4d(100, 100, 99.5, 49.5);
  return camera;
}

TEST(DrawSolids, TintsTheBodyAndOutlinesTheBoard) {
  SolidsNow solids;
  solids.vertices.resize(3, 3);
  solids.vertices << -0.6, 0.6, 0, -0.4, -0.4, 0.4, 1, 1, 1;
  solids.faces.resize(3, 1);
  solids.faces << 0, 1, 2;
  Image whole(200, 100, 3, 100), half(100, 50, 3, 100);
  DrawSolids(solids, Pinhole(), {1, 1}, &whole);
  DrawSolids(solids, Pinhole(), {0.5, 0.5}, &half);
  const uint8_t tinted[] = {134, 110, 154};  // 0.65 x 100 + 0.35 x (196, 128, 255)
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(whole.Pixel(100, 30)[k], tinted[k]);
    EXPECT_EQ(half.Pixel(50, 15)[k], tinted[k]);
    EXPECT_EQ(whole.Pixel(100, 5)[k], 100) << "above it";
  }
  PlacedBoard board;
  board.corners = Eigen::Vector3d(0.5, 0.2, 1);
  board.axes.resize(3, 3);
  board.axes << 0, 0.3, 0, 0, 0, 0.3, 1, 1, 1;
  Image blank(200, 100, 3);
  DrawSolids({{board}, {}, {}}, Pinhole(), {1, 1}, &blank);
  EXPECT_GT(blank.Pixel(150, 70)[0], 200) << "the corner, f x / z from the middle";
  EXPECT_GT(blank.Pixel(115, 50)[0], blank.Pixel(115, 50)[1]) << "x is red";
  EXPECT_GT(blank.Pixel(100, 65)[1], blank.Pixel(100, 65)[0]) << "y is green";
}

TEST(WithRender, StandsRightOfTheTileAndNeverLarger) {
  const Image both = WithRender(Image(40, 20, 3, 10), Image(100, 100, 3, 90));
  ASSERT_EQ(both.width, 80);
  ASSERT_EQ(both.height, 20);
  EXPECT_EQ(*both.Pixel(39, 19), 10);
  EXPECT_EQ(*both.Pixel(40, 0), 90);
  EXPECT_EQ(*both.Pixel(59, 19), 90);
  EXPECT_EQ(*both.Pixel(60, 0), 0) << "square";
  EXPECT_EQ(*WithRender(Image(40, 20, 3, 10), {}).Pixel(50, 10), 0);
}

TEST(RunOverlay, RendersStandBesideTheirCameras) {
  const TempDir folder;
  WriteFileAtomic(folder / "t.trc",
                  "PathFileType\t4\t(X/Y/Z)\tt.trc\n"
                  "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
                  "60\t60\t2\t2\tm\t60\t1\t2\nFrame#\tTime\tRHip\t\t\tRKnee\t\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
                  "1\t0\t0\t1\t0\t0.5\t1.5\t0\n2\t0.0167\t0\t1.1\t0\t0.5\t1.6\t0\n");
  OverlayOptions options;
  options.scene.path = folder / "t.trc", options.out = folder / "out", options.tile_px = 64, options.num_sheet = 1;
  options.beside = folder / "renders";
  EXPECT_THAT(MessageOf<IoError>([&] { RunOverlay(options); }), HasSubstr("is no folder that is there"));
  MakeFolder(folder / "renders/other");
  EXPECT_THAT(MessageOf<UsageError>([&] { RunOverlay(options); }), HasSubstr("has no folder CAMERA"));
  MakeFolder(folder / "renders/front");
  for (const char* name : {"front_00000000.png", "front_00000001.png", "front_00000002.png"})
    dataset::WriteImage(Image(30, 30, 3, 200), folder / (std::string("renders/front/") + name));
  RunOverlay(options);
  const Image sheet = dataset::ReadImage(folder / "out/sheet.png");
  EXPECT_EQ(sheet.width, 2 * 128) << "two columns as wide as the widest cell";
  EXPECT_EQ(*sheet.Pixel(64 + 10, 10), 200);
  EXPECT_TRUE(std::filesystem::exists(folder / "out/overlay.mp4"));
}

}  // namespace
}  // namespace mvstudio::stages
