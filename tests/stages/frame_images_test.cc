#include "stages/input/frame_images.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <tuple>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;
using ::testing::EndsWith;

Image Noise(int width, int height) {
  Image image(width, height, 3);
  Rng rng(1);
  for (uint8_t& value : image.pixels) value = static_cast<uint8_t>(rng.Uniform(0, 256));
  return image;
}

TEST(FrameImages, ReducedByAveraging) {
  Image image(4, 2, 1);
  image.pixels = {0, 100, 10, 10, 100, 200, 10, 10};
  const Image half = dataset::Reduced(image, 2);
  EXPECT_EQ(half.width, 2);
  EXPECT_EQ(half.height, 1);
  EXPECT_THAT(half.pixels, ElementsAre(100, 10));
  EXPECT_EQ(dataset::Reduced(image, 9).pixels, image.pixels) << "never enlarged";
  EXPECT_EQ(dataset::Reduced(Image(1000, 1, 1, 7), 3).height, 1);
}

TEST(FrameImages, KeepTheirLimitOfBytesEvenOfNoise) {
  const Image image = Noise(800, 600);
  TempDir folder;
  for (const size_t most : {60000u, 8000u}) {
    const FrameImage small = SmallImage(image, 640, most);
    EXPECT_LE(small.jpeg.size(), most);
    WriteFileAtomic(folder / "a.jpg", small.jpeg);
    const Image read = dataset::ReadImage(folder / "a.jpg");
    EXPECT_NEAR(read.width / double(read.height), 4.0 / 3, 0.03);
  }
  EXPECT_LT(SmallImage(Image(64, 64, 3, 128), 640, 1).jpeg.size(), 2000u) << "no limit is kept at the price of no image";
}

TEST(FrameImages, APartOfAFrame) {
  Image image(60, 40, 3, 0);
  for (int y = 10; y < 30; ++y) std::fill(image.Pixel(20, y), image.Pixel(50, y), uint8_t{255});
  TempDir folder;
  WriteFileAtomic(folder / "a.jpg", SmallImage(image, {{}, 20, 10, 30, 20}, 640, 60000).jpeg);
  const Image part = dataset::ReadImage(folder / "a.jpg");
  EXPECT_EQ(part.width, 30);
  EXPECT_EQ(part.height, 20);
  EXPECT_GT(*std::min_element(part.pixels.begin(), part.pixels.end()), 250);
  EXPECT_THROW(SmallImage(image, {{}, 40, 0, 21, 10}, 640, 60000), ContractViolation);
}

TEST(FrameImages, ABoxAroundThePointsInsideTheFrame) {
  const geometry::Camera camera = geometry::MakePinhole("c", 640, 480, 500);
  const double nan = std::nan("");
  FrameImage box = BoxAround({{100, 100}, {300, 150}, {nan, 2}, {-50, 900}}, camera);
  EXPECT_EQ(std::make_tuple(box.x, box.y, box.width, box.height), std::make_tuple(75, 75, 250, 100));
  box = BoxAround({{2, 3}, {600, 470}}, camera);
  EXPECT_EQ(std::make_tuple(box.x, box.y, box.width, box.height), std::make_tuple(0, 0, 640, 480));
  box = BoxAround({{nan, nan}, {1e300, 4}}, camera);
  EXPECT_EQ(std::make_tuple(box.x, box.y, box.width, box.height), std::make_tuple(0, 0, 640, 480));
  box = BoxAround({{639, 0}}, camera);
  EXPECT_EQ(std::make_tuple(box.x, box.y, box.width, box.height), std::make_tuple(619, 0, 21, 20));
}

TEST(FrameImages, AreFoundByTheirNumbers) {
  TempDir folder;
  for (const int number : {3, 7, 12})
    dataset::WriteImage(Image(8, 8, 1, static_cast<uint8_t>(number)), folder / ("a/img" + std::to_string(number) + ".png"));
  const auto images = ReadFrames(folder / "a", {7, 12, 13});
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images.at(12).pixels[0], 12);
  EXPECT_EQ(LastCheapFrame(folder / "a"), std::numeric_limits<int64_t>::max());
  EXPECT_THAT(ReadFrames(folder / "gone", {7}), IsEmpty());
  WriteFileAtomic(folder / "b/img7.png", "no image");
  EXPECT_THAT(ReadFrames(folder / "b", {7}), IsEmpty());
  dataset::VideoWriter video(folder / "c.mp4", 16, 16, 25);
  for (int i = 0; i < 3; ++i) video.Write(Image(16, 16, 3, static_cast<uint8_t>(80 * i)));
  video.Close();
  EXPECT_NEAR(ReadFrames(folder / "c.mp4", {2}).at(2).pixels[0], 160, 6);
  EXPECT_EQ(LastCheapFrame(folder / "c.mp4"), 299);
}

TEST(FrameImages, ReplaceThoseOfAnEarlierRunAndNothingElse) {
  TempDir folder;
  const std::string place = folder / "views";
  EXPECT_THAT(WriteImages({"one", "", "two"}, {"a.jpg", "b.jpg", "c.jpg"}, place),
              ElementsAre(EndsWith("views/a.jpg"), IsEmpty(), EndsWith("views/c.jpg")));
  WriteImages({"three"}, {"d.jpg"}, place);
  EXPECT_FALSE(fs::exists(place + "/a.jpg"));
  EXPECT_EQ(ReadFile(place + "/d.jpg"), "three");
  WriteImages({""}, {"d.jpg"}, place);
  EXPECT_FALSE(fs::exists(place));
  fs::create_directory(place);
  std::ofstream(place + "/mine.txt") << "mine";
  EXPECT_THROW(WriteImages({"one"}, {"a.jpg"}, place), UsageError);
  EXPECT_THROW(WriteImages({""}, {"a.jpg"}, place), UsageError);
  EXPECT_EQ(ReadFile(place + "/mine.txt"), "mine");
}

}  // namespace
}  // namespace mvstudio::stages
