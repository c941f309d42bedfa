#include "dataset/detect/segment/segment.h"

#include <cstring>
#include <fstream>

#include "core/error.h"
#include "dataset/detect/models/models.h"
#include "tests/detect/tiny_onnx.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::detect {
namespace {

/// A red square on blue.
Image RedSquare(int width, int height, const ImageBox& box) {
  Image image(width, height, 3, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool in = x >= box.x0 && x < box.x1 && y >= box.y0 && y < box.y1;
      image.Pixel(x, y)[in ? 0 : 2] = 255;
    }
  }
  return image;
}

OnnxSegmenterOptions Small() {
  OnnxSegmenterOptions options;
  options.width = options.height = 32;
  return options;
}

TEST(Segment, OneChannelOfLogitsFindsTheRedSquare) {
  mvstudio::testing::TempDir folder;
  const std::string path = folder.path() + "/net.onnx";
  WriteOnnx(path, 1, {12, 0, -12}, {0});
  const ImageBox box{100, 60, 180, 160};
  const auto net = OnnxSegmenter(path, Small());
  for (const ImageBox& around : {ImageBox{}, ImageBox{90, 50, 190, 170}}) {
    const Image p = net->Probability(RedSquare(300, 200, box), around);
    ASSERT_EQ(p.width, 300);
    ASSERT_EQ(p.height, 200);
    EXPECT_GT(*p.Pixel(140, 110), 240);
    EXPECT_GT(*p.Pixel(108, 68), 128);
    EXPECT_LT(*p.Pixel(80, 110), 15);
    EXPECT_LT(*p.Pixel(250, 30), 15);
  }
}

TEST(Segment, TheChannelOfThePersonIsTaken) {
  mvstudio::testing::TempDir folder;
  const std::string two = folder.path() + "/two.onnx", three = folder.path() + "/three.onnx";
  WriteOnnx(two, 2, {0, 0, 10, 10, 0, 0}, {0, 0});  // background, person
  WriteOnnx(three, 3, {10, 0, 0, 0, 0, 10, 0, 10, 0}, {0, 0, 0});
  const Image image = RedSquare(64, 64, {16, 16, 48, 48});
  EXPECT_GT(*OnnxSegmenter(two, Small())->Probability(image, {0, 0, 64, 64}).Pixel(32, 32), 240);
  EXPECT_THROW(OnnxSegmenter(three, Small())->Probability(image, {0, 0, 64, 64}), UsageError);
  OnnxSegmenterOptions options = Small();
  options.person_channel = 0;
  const Image p = OnnxSegmenter(three, options)->Probability(image, {0, 0, 64, 64});
  EXPECT_GT(*p.Pixel(32, 32), 240);
  EXPECT_LT(*p.Pixel(4, 4), 15);
}

TEST(Segment, WrongFilesAndSizesAreErrors) {
  mvstudio::testing::TempDir folder;
  const std::string path = folder.path() + "/net.onnx";
  EXPECT_THROW(OnnxSegmenter(path), IoError);
  std::ofstream(path) << "this is no net";
  EXPECT_THROW(OnnxSegmenter(path), FormatError);
  OnnxSegmenterOptions options;
  options.width = 0;
  EXPECT_THROW(OnnxSegmenter(path, options), FormatError) << "a bad file is not hidden by a bad size";
  EXPECT_THROW(SelfieSegmenter(folder.path() + "/nothing"), MissingToolError);
}

TEST(Segment, BoxesStayInsideTheImage) {
  Image grey(50, 40, 1, 0);
  EXPECT_TRUE(BoxAround(grey, 1, 0.2).empty());
  *grey.Pixel(2, 3) = 200, *grey.Pixel(30, 39) = 200;
  const ImageBox box = BoxAround(grey, 128, 0.5);
  EXPECT_EQ(box.x0, 0);
  EXPECT_EQ(box.y0, 0);
  EXPECT_EQ(box.x1, 50);
  EXPECT_EQ(box.y1, 40);
}

TEST(Segment, SelfieSeesNobodyInAnEmptyImage) {
  if (!HasModel("selfie")) GTEST_SKIP() << "needs the net 'selfie': mvstudio models fetch";
  const auto net = SelfieSegmenter();
  for (const auto& [w, h] : {std::pair(1, 1), std::pair(640, 360)}) {
    const Image p = net->Probability(Image(w, h, 3, 0), {});
    ASSERT_EQ(p.width, w);
    double sum = 0;
    for (const uint8_t v : p.pixels) sum += v;
    EXPECT_LT(sum / double(p.pixels.size()), 64);
  }
}

}  // namespace
}  // namespace mvstudio::detect
