#include "core/error.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/video_io.h"
#include "tests/dataset/clip_writer.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

TEST(VideoIo, RotationIsApplied) {
  const TempDir folder;
  for (const int deg : {90, 180, 270}) {
    ClipOptions options;
    options.clockwise_deg = deg;
    WriteClip(folder / "turned.mp4", Regular(3), options, {1, 1, 1});
    VideoReader reader(folder / "turned.mp4");
    EXPECT_EQ(reader.info().turn.quarter_turns_clockwise, deg / 90);
    EXPECT_EQ(reader.info().width, deg == 180 ? 128 : 64);
    const auto image = reader.Next();
    ASSERT_TRUE(image);
    ASSERT_EQ(image->width, reader.info().width);
    // The white bar stands at the left edge of the coded image.
    const auto white = [&](int x, int y) { return image->Pixel(x, y)[0] > 127; };
    EXPECT_EQ(white(image->width / 2, 3), deg == 90) << deg;
    EXPECT_EQ(white(image->width - 4, image->height / 2), deg == 180) << deg;
    EXPECT_EQ(white(image->width / 2, image->height - 4), deg == 270) << deg;
  }
}

/// ISO 14496-12: a pixel (x, y) is shown at (a x + c y, b x + d y), up to a shift. The quarters of the
/// clip have levels of their own.
TEST(VideoIo, MirroredDisplayMatricesAreApplied) {
  const TempDir folder;
  for (const std::array<double, 4> matrix : {std::array<double, 4>{-1, 0, 0, 1},
                                             {1, 0, 0, -1},
                                             {0, 1, 1, 0},
                                             {0, -1, -1, 0},
                                             {0, 1, -1, 0},
                                             {-1, 0, 0, -1},
                                             {0, -1, 1, 0},
                                             {2, 0, 0, 2}}) {
    ClipOptions options;
    options.matrix = matrix;
    options.level = [](int x, int y) { return static_cast<uint8_t>(x < 64 ? (y < 32 ? 210 : 160) : (y < 32 ? 100 : 40)); };
    const double a = matrix[0], b = matrix[1], c = matrix[2], d = matrix[3];
    WriteClip(folder / "turned.mp4", Regular(2), options);
    VideoReader reader(folder / "turned.mp4");
    const auto image = reader.Next();
    ASSERT_TRUE(image);
    const bool swaps = a == 0;
    ASSERT_EQ(image->width, swaps ? 64 : 128);
    ASSERT_EQ(image->height, swaps ? 128 : 64);
    EXPECT_EQ(reader.info().turn.mirrored, a * d - b * c < 0);
    for (const auto& [x, y] : {std::pair{10, 10}, {10, 50}, {100, 10}, {100, 50}}) {
      const double across = a * x + c * y, down = b * x + d * y, scale = std::abs(a) + std::abs(b);
      const int u = static_cast<int>(across / scale + (across < 0 ? image->width - 1 : 0));
      const int v = static_cast<int>(down / scale + (down < 0 ? image->height - 1 : 0));
      EXPECT_NEAR(image->Pixel(u, v)[0], (options.level(x, y) - 16) * 255 / 219.0, 6)
          << a << b << c << d << " " << x << " " << y;
    }
  }
}

TEST(VideoIo, OtherDisplayMatricesAreRefused) {
  const TempDir folder;
  const double s = std::sqrt(0.5);
  for (const std::array<double, 4> matrix :
       {std::array<double, 4>{s, s, -s, s}, {1, 0, 0.5, 1}, {1, 0.2, 0, 1}, {1, 0, 0, 0}}) {
    ClipOptions options;
    options.matrix = matrix;
    WriteClip(folder / "odd.mp4", Regular(2), options);
    EXPECT_THAT(mvstudio::testing::MessageOf<FormatError>([&] { VideoReader reader(folder / "odd.mp4"); }),
                ::testing::AllOf(::testing::HasSubstr("display matrix"), ::testing::HasSubstr("write the video anew")));
  }
}

TEST(VideoIo, PixelsThatAreNotSquareAreNamed) {
  const TempDir folder;
  ClipOptions options;
  options.pixel_aspect = {16, 11};
  WriteClip(folder / "wide.mkv", Regular(2), options);
  EXPECT_NEAR(VideoReader(folder / "wide.mkv").info().pixel_aspect, 16.0 / 11, 1e-3);
  const FootageInfo info = DescribeFootage(folder / "wide.mkv");
  ASSERT_EQ(info.notes.size(), 1u);
  EXPECT_EQ(info.notes[0].code, "SES-ASPECT");
}

TEST(VideoIo, TenBitsBecomeEightWithoutAShift) {
  const TempDir folder;
  ClipOptions options;
  options.ten_bit = true;
  options.codec = "ffv1";
  WriteClip(folder / "ten.mkv", Regular(2), options, {1, 1});
  const auto image = VideoReader(folder / "ten.mkv").Next();
  ASSERT_TRUE(image);
  EXPECT_NEAR(image->Pixel(2, 9)[0], (225 - 16) * 255 / 219.0, 1.5);  // limited range
  EXPECT_NEAR(image->Pixel(90, 9)[0], (30 - 16) * 255 / 219.0, 1.5);
}

}  // namespace
}  // namespace mvstudio::dataset
