#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/view/avatar_view.h"
#include "stages/view/marks.h"
#include "stages/view/scene.h"
#include "stages/view/scene_parts.h"
#include "stages/view/view_page.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// Outlines of masks, bodies and boards as the page of frames draws them, and which images were held out.
namespace mvstudio::stages {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;
using ::testing::SizeIs;

/// Positive to the right hand of the line, with y down.
double SignedArea(const OutlinePx& line) {
  double twice = 0;
  for (size_t i = 0; i < line.size(); ++i) {
    const Eigen::Vector2d &a = line[i], &b = line[(i + 1) % line.size()];
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return twice / 2;
}

double SignedArea(const std::vector<OutlinePx>& lines) {
  double sum = 0;
  for (const OutlinePx& line : lines) sum += SignedArea(line);
  return sum;
}

Image Filled(int width, int height, int left, int top, int right, int bottom) {
  Image mask(width, height, 1);
  for (int y = top; y < bottom; ++y)
    for (int x = left; x < right; ++x) *mask.Pixel(x, y) = 255;
  return mask;
}

TEST(Outlines, ARectangleHasItsFourCorners) {
  const auto lines = OutlinesOf(Filled(20, 10, 3, 2, 9, 8), 0.75);
  ASSERT_THAT(lines, SizeIs(1));
  EXPECT_THAT(lines[0], ::testing::UnorderedElementsAre(Eigen::Vector2d(2.5, 1.5), Eigen::Vector2d(8.5, 1.5),
                                                        Eigen::Vector2d(8.5, 7.5), Eigen::Vector2d(2.5, 7.5)));
  EXPECT_THAT(OutlinesOf(Filled(20, 10, 0, 0, 20, 10), 0.75), SizeIs(1)) << "up to the border";
  EXPECT_THAT(OutlinesOf(Image(20, 10, 1), 0.75), SizeIs(0));
  EXPECT_THAT(OutlinesOf(Image(), 0.75), SizeIs(0));
}

TEST(Outlines, HolesAndPixelsThatTouchAtACornerHaveTheirOwn) {
  Image ring = Filled(10, 10, 1, 1, 9, 9);
  *ring.Pixel(4, 4) = 0;
  const auto lines = OutlinesOf(ring, 0);
  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_EQ(SignedArea(lines[0]), 64);
  EXPECT_EQ(SignedArea(lines[1]), -1);
  Image pair(4, 4, 1);
  *pair.Pixel(1, 1) = *pair.Pixel(2, 2) = 255;
  EXPECT_THAT(OutlinesOf(pair, 0), SizeIs(2));
}

TEST(Outlines, EncloseAsManyPixelsAsTheMaskHas) {
  std::mt19937 random(7);
  for (int round = 0; round < 200; ++round) {
    Image mask(1 + static_cast<int>(random() % 30), 1 + static_cast<int>(random() % 30), 1);
    double count = 0;
    for (uint8_t& pixel : mask.pixels) pixel = random() % 3 > 0 ? 255 : 0, count += pixel > 0;
    EXPECT_EQ(SignedArea(OutlinesOf(mask, 0)), count) << "round " << round;
  }
}

TEST(Outlines, OfADiscStayWithinTheTolerance) {
  constexpr double kRadius = 150, kTolerance = 1;
  Image mask(400, 400, 1);
  for (int y = 0; y < 400; ++y)
    for (int x = 0; x < 400; ++x) *mask.Pixel(x, y) = std::hypot(x - 200, y - 200) < kRadius ? 255 : 0;
  const auto lines = OutlinesOf(mask, kTolerance);
  ASSERT_THAT(lines, SizeIs(1));
  EXPECT_LT(lines[0].size(), 120u) << "of some 1,200 edges of pixels";
  for (const Eigen::Vector2d& px : lines[0]) EXPECT_NEAR((px - Eigen::Vector2d(200, 200)).norm(), kRadius, 1.5);
  EXPECT_NEAR(SignedArea(lines) / (M_PI * kRadius * kRadius), 1, 0.01);
}

/// A triangle that stands still at time step 4.
MovingBody StandingTriangle() {
  MovingBody body;
  body.rest.resize(3, 3), body.faces.resize(3, 1), body.bones.setZero(4, 3), body.weights.setZero(4, 3);
  body.rest << -0.5, 0.5, 0.5, -0.4, -0.4, 0.4, 1, 1, 1;
  body.faces << 0, 1, 2;
  body.weights.row(0).setOnes();
  body.frames = {4}, body.at_frame = {{geometry::Rigid3()}};
  return body;
}

/// One camera of 200 x 100 px at the origin that looks along z, with masks in a folder.
Scene OneCamera(const std::string& masks) {
  Scene scene;
  geometry::RigCamera camera;
  camera.camera.name = "cam";
  camera.camera.model = geometry::LensModel::kPinhole;
  camera.camera.width_px = 200, camera.camera.height_px = 100;
  camera.camera.params = Eigen::Vector4d(100, 100, 99.5, 49.5);
  scene.rig.cameras = {camera};
  scene.cameras = {{"cam", 0, "", masks}};
  return scene;
}

TEST(Marks, LieWhereTheLensAndTheMaskPutThem) {
  const TempDir folder;
  std::filesystem::create_directories(folder / "masks");
  dataset::WriteImage(Filled(100, 50, 10, 5, 30, 45), folder / "masks/00000004.png");  // half as large as the lens
  const Scene scene = OneCamera(folder / "masks");
  OverlaySolids solids;
  PlacedBoard board;
  board.outline.resize(3, 4), board.axes.resize(3, 3);
  board.outline << 0, 1, 1, 0, 0, 0, 1, 1, 2, 2, 2, 2;
  board.axes << 0, 0.5, 0, 0, 0, 0.5, 2, 2, 2;
  solids.boards[4] = {board};
  solids.body = StandingTriangle();
  MarksReader reader(scene, solids);
  EXPECT_TRUE(reader.has_masks() && reader.has_body() && reader.has_boards());
  const ViewMarks marks = reader.At(0, 4);
  ASSERT_THAT(marks.mask, SizeIs(1));
  EXPECT_THAT(marks.mask[0], ::testing::UnorderedElementsAre(Eigen::Vector2d(19.5, 9.5), Eigen::Vector2d(59.5, 9.5),
                                                             Eigen::Vector2d(59.5, 89.5), Eigen::Vector2d(19.5, 89.5)));
  EXPECT_NEAR(SignedArea(marks.body), 100 * 80 / 2.0, 0.03 * 4000);
  ASSERT_THAT(marks.boards, SizeIs(4));
  EXPECT_LT((marks.boards[0].front() - Eigen::Vector2d(99.5, 49.5)).norm(), 1e-9);
  EXPECT_LT((marks.boards[0].back() - Eigen::Vector2d(149.5, 49.5)).norm(), 1e-9);
  EXPECT_LT((marks.y_axes.at(0).back() - Eigen::Vector2d(99.5, 74.5)).norm(), 1e-9);
  EXPECT_THAT(ViewMarksJson(marks), HasSubstr(R"("x_axes":[[99.5,49.5,)"));
  const ViewMarks other = reader.At(0, 5);
  EXPECT_TRUE(other.mask.empty() && other.body.empty() && other.boards.empty()) << "another time step";
}

TEST(Avatar, IsTheBodyInItsColoursOrARender) {
  const TempDir folder;
  Image atlas(8, 8, 3);  // its left half red, its right half blue
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 8; ++x) atlas.Pixel(x, y)[x < 4 ? 0 : 2] = 255;
  const std::string image = dataset::EncodeImage(atlas, "atlas.png");
  std::string file = "MVBTEX01";
  const auto add = [&](auto number) { file.append(reinterpret_cast<const char*>(&number), sizeof number); };
  for (const uint32_t count : {uint32_t{3}, uint32_t{1}, static_cast<uint32_t>(image.size()), 0u, 1u, 2u}) add(count);
  for (const int share : {0, 0, 65535, 0, 65535, 65535}) add(static_cast<uint16_t>(share));
  for (const uint32_t corner : {0u, 1u, 2u}) add(corner);
  file += image;
  WriteFileAtomic(folder / "body_texture.bin", file);
  const Scene scene = OneCamera("");
  OverlaySolids solids;
  solids.body = StandingTriangle(), solids.colours = ReadBodyColours(folder / "body_texture.bin", 3);
  const Image seen = BodyInColours(*solids.colours, SolidsAt(solids, 4).vertices, scene.rig.cameras[0], 1000);
  ASSERT_EQ(seen.width, 200);
  const auto at = [&](int x, int y) { return std::vector<int>(seen.Pixel(x, y), seen.Pixel(x, y) + 4); };
  EXPECT_EQ(at(80, 15), (std::vector<int>{255, 0, 0, 255}));
  EXPECT_EQ(at(120, 15), (std::vector<int>{0, 0, 255, 255}));
  EXPECT_EQ(at(60, 80), (std::vector<int>{0, 0, 0, 0})) << "outside of the triangle";
  EXPECT_EQ(BodyInColours(*solids.colours, SolidsAt(solids, 4).vertices, scene.rig.cameras[0], 100).height, 50);
  const AvatarView view(scene, solids, "");
  EXPECT_TRUE(view.any());
  EXPECT_THAT(view.At(0, 4), HasSubstr("PNG"));
  EXPECT_EQ(view.At(0, 5), "") << "another time step";
  EXPECT_THROW(ReadBodyColours(folder / "body_texture.bin", 2), FormatError) << "of a larger body";
  WriteFileAtomic(folder / "cut.bin", file.substr(0, 40));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadBodyColours(folder / "cut.bin", 3); }), HasSubstr("it was cut"));
  EXPECT_THAT(MessageOf<UsageError>([&] { AvatarView(scene, solids, folder.path()); }), HasSubstr("option 'avatar'"));
  std::filesystem::create_directories(folder / "cam");
  dataset::WriteImage(Image(4, 2, 4, 9), folder / "cam/x_00000007.png");
  const AvatarView renders(scene, solids, folder.path());
  EXPECT_THAT(renders.At(0, 7), HasSubstr("PNG"));
  EXPECT_EQ(renders.At(0, 4), "") << "a folder of renders takes the body's place";
}

TEST(Marks, NoMaskThatALinkLeadsOutside) {
  const TempDir folder, elsewhere;
  std::filesystem::create_directories(folder / "masks");
  dataset::WriteImage(Filled(100, 50, 10, 5, 30, 45), elsewhere / "m.png");
  std::filesystem::create_symlink(elsewhere / "m.png", folder / "masks/00000004.png");
  Scene scene = OneCamera(folder / "masks");
  scene.root = folder.path();
  EXPECT_THAT(MessageOf<UsageError>([&] { MarksReader(scene, {}).At(0, 4); }), HasSubstr("lies outside of"));
  scene.root.clear();
  EXPECT_THAT(MarksReader(scene, {}).At(0, 4).mask, SizeIs(1));
}

TEST(FootageAlone, IsACameraForEachFolderOrOneOfImages) {
  const TempDir folder;
  for (const char* camera : {"left", "right"}) {
    std::filesystem::create_directories(folder / camera);
    for (const char* name : {"000003.png", "000004.png"})
      dataset::WriteImage(Image(32, 16, 3, 90), folder / camera + "/" + name);
  }
  InputNotes notes;
  const Scene both = ReadScene({folder.path(), "", false}, &notes);
  EXPECT_EQ(both.kind, "footage");
  ASSERT_THAT(both.cameras, SizeIs(2));
  EXPECT_EQ(both.cameras[0].name, "left");
  EXPECT_EQ(both.cameras[1].footage, folder / "right");
  EXPECT_EQ(both.steps, (std::vector<int>{3, 4}));
  const Scene one = ReadScene({folder / "left", "", false}, &notes);
  ASSERT_THAT(one.cameras, SizeIs(1));
  EXPECT_EQ(one.cameras[0].name, "left");
  EXPECT_EQ(one.steps, (std::vector<int>{3, 4}));
  WriteFileAtomic(folder / "calibrate.result.json", "{}");
  EXPECT_THAT(ReadScene({folder.path(), "", false}, &notes).cameras, SizeIs(0)) << "images of a run are no footage";
}

TEST(HeldOut, StepsOfTheProtocolAndScoresOfTheImages) {
  const TempDir folder;
  WriteFileAtomic(folder / "protocol.json", R"({"protocol": {"holdout": {"frames": [3, 4, -1, "x", 1e300]}}})");
  WriteFileAtomic(
      folder / "avatar_eval.result.json",
      R"({"metrics": {"pictures": [{"camera": "b", "frame": 4, "ssim": 0.9}, {"camera": "a", "frame": 4, "ssim": 0.8, "path": "/moved/eval/a.png"},
                      {"camera": "a", "frame": 5}, {"camera": 1, "frame": 6}, 7, {"frame": 8}]}})");
  std::filesystem::create_directories(folder / "eval");
  WriteFileAtomic(folder / "eval/a.png", "");
  Scene scene = OneCamera("");
  scene.steps = {3, 4, 5, 6};
  ReadHeldOut(folder.path(), &scene);
  ASSERT_THAT(scene.held_out, SizeIs(3));
  EXPECT_TRUE(scene.held_out.at(3).empty());
  EXPECT_EQ(scene.held_out.at(4).at("a"), 0.8);
  EXPECT_TRUE(std::isnan(scene.held_out.at(5).at("a")));
  const std::string json = ViewSceneJson(scene, MarksReader(scene, {}), false, false);
  EXPECT_THAT(json, HasSubstr(R"("held_out":{"3":{},"4":{"a":0.8,"b":0.9},"5":{"a":null}})"));
  EXPECT_THAT(json, HasSubstr(R"("steps":[[3,null,0,null],[4,null,0,0.8],[5,null,0,null],[6,null,0,-1]])"));
  EXPECT_THAT(json, HasSubstr(R"("scored":{"4":["a"]})"));
  EXPECT_EQ(scene.scored.at(4).at("a"), folder / "eval/a.png");
  EXPECT_THAT(json, HasSubstr(R"("has_masks":false)"));
  for (const char* damaged : {"", "[1", "{\"metrics\": 3}", "{\"protocol\": {\"holdout\": {\"frames\": 7}}}"}) {
    WriteFileAtomic(folder / "protocol.json", damaged);
    WriteFileAtomic(folder / "avatar_eval.result.json", damaged);
    Scene none = OneCamera("");
    ReadHeldOut(folder.path(), &none);
    EXPECT_TRUE(none.held_out.empty()) << damaged;
  }
}

TEST(ViewScene, FootageThatALinkLeadsOutsideIsNamed) {
  const TempDir elsewhere, folder;
  WriteFileAtomic(elsewhere / "a.mp4", "footage of somebody else");
  std::filesystem::create_symlink(elsewhere / "a.mp4", folder / "a.mp4");
  ViewSceneOptions options;
  options.path = folder.path();
  InputNotes notes;
  EXPECT_THAT(ReadScene(options, &notes).cameras, SizeIs(0));
  ASSERT_THAT(notes.warnings, SizeIs(1));
  EXPECT_EQ(notes.warnings[0].code, "VIEW-LEFTOUT");
  EXPECT_THAT(notes.warnings[0].text, HasSubstr("a.mp4: a link leads outside"));
  EXPECT_THAT(notes.warnings[0].text, HasSubstr("option 'allow-outside'"));
}

}  // namespace
}  // namespace mvstudio::stages
