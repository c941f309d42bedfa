#include "dataset/video_io.h"

#include <filesystem>

#include "core/error.h"
#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {
namespace {

void WriteVideo(const std::string& path, int width, int height, int frames, int crf, bool full_chroma) {
  VideoWriter writer(path, width, height, 30, crf, full_chroma);
  for (int i = 0; i < frames; ++i) writer.Write(SmoothImage(width, height, 0.2 * i));
  writer.Close();
}

TEST(VideoIo, RoundTripKeepsColourCountAndOrder) {
  mvstudio::testing::TempDir folder;
  for (const bool full_chroma : {false, true}) {
    WriteVideo(folder / "a.mp4", 160, 96, 25, 0, full_chroma);  // no loss but the rounding of 8-bit YUV
    VideoReader reader(folder / "a.mp4");
    EXPECT_EQ(reader.info().width, 160);
    EXPECT_EQ(reader.info().height, 96);
    EXPECT_NEAR(reader.info().frame_rate_hz, 30, 1e-9);
    EXPECT_EQ(reader.info().num_frames, 25);
    EXPECT_EQ(reader.info().codec, "h264");
    int count = 0;
    while (const auto image = reader.Next()) {
      EXPECT_LT(MeanAbsDifference(*image, SmoothImage(160, 96, 0.2 * count)), full_chroma ? 0.8 : 1.2) << "frame " << count;
      EXPECT_EQ(reader.frame_idx(), count);
      EXPECT_NEAR(reader.time_s(), count / 30.0, 1e-4);
      ++count;
    }
    EXPECT_EQ(count, 25);
  }
}

TEST(VideoIo, FlatColoursSurviveWithinTwoLevels) {
  mvstudio::testing::TempDir folder;
  const uint8_t colours[][3] = {{255, 0, 0}, {0, 255, 0},     {0, 0, 255},  {255, 255, 255},
                                {0, 0, 0},   {200, 150, 120}, {17, 99, 230}};
  VideoWriter writer(folder / "a.mp4", 64, 64, 25, 0);
  for (const auto& c : colours) {
    Image image(64, 64, 3);
    for (int i = 0; i < 64 * 64; ++i) std::copy_n(c, 3, &image.pixels[3 * i]);
    writer.Write(image);
  }
  writer.Close();
  VideoReader reader(folder / "a.mp4");
  for (const auto& c : colours) {
    const auto image = reader.Next();
    ASSERT_TRUE(image);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(image->Pixel(31, 31)[k], c[k], 2) << "channel " << k << " of " << int{c[0]};
  }
}

TEST(VideoIo, SameInputSameBytes) {
  mvstudio::testing::TempDir folder;
  WriteVideo(folder / "a.mp4", 64, 48, 12, 16, false);
  WriteVideo(folder / "b.mp4", 64, 48, 12, 16, false);
  EXPECT_EQ(ReadFile(folder / "a.mp4"), ReadFile(folder / "b.mp4"));
}

TEST(VideoIo, AppearsOnCloseOnly) {
  mvstudio::testing::TempDir folder;
  {
    VideoWriter writer(folder / "a.mp4", 64, 48, 25);
    writer.Write(Image(64, 48, 3, 9));
    EXPECT_FALSE(std::filesystem::exists(folder / "a.mp4"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(VideoIo, EveryTruncationIsAFormatErrorThatNamesTheFrame) {
  mvstudio::testing::TempDir folder;
  WriteVideo(folder / "a.mp4", 160, 96, 20, 8, false);
  for (int percent = 0; percent < 100; percent += 7) {
    Truncate(folder / "a.mp4", folder / "cut.mp4", percent / 100.0);
    int decoded = 0;
    try {
      VideoReader reader(folder / "cut.mp4");
      while (reader.Next()) ++decoded;
      ADD_FAILURE() << percent << " %: " << decoded << " frames and no error";
    } catch (const FormatError& error) {
      if (decoded > 0) {
        EXPECT_EQ(error.where(), "frame " + std::to_string(decoded));
      }
    }
  }
}

TEST(VideoIo, ContractAndMissingFile) {
  mvstudio::testing::TempDir folder;
  EXPECT_THROW(VideoReader(folder / "none.mp4"), IoError);
  EXPECT_THROW(VideoReader(folder.path()), IoError);
  EXPECT_THROW(VideoWriter(folder / "a.mp4", 63, 48, 25), ContractViolation);
  EXPECT_THROW(VideoWriter(folder / "a.mp4", 64, 48, 25, 60), ContractViolation);
}

TEST(VideoIo, RealH264AndVp9DecodeToTheirLastFrame) {
  MVS_NEEDS_DATA("pose2sim");
  const std::string data = DataFolder("pose2sim");
  struct Expected {
    const char* file;
    const char* codec;
    int width, frames;
  };
  const Expected files[] = {{"static/videos/cam01.mp4", "h264", 1088, 11}, {"static/videos/cam03.mp4", "h264", 1080, 11}};
  for (const Expected& e : files) {
    VideoReader reader(data + "/" + e.file);
    EXPECT_EQ(reader.info().codec, e.codec);
    EXPECT_EQ(reader.info().width, e.width);
    int count = 0;
    while (reader.Next()) ++count;
    EXPECT_EQ(count, e.frames) << e.file;
  }
  VideoReader vp9(data + "/balancing/videos/cam02.mp4");
  EXPECT_EQ(vp9.info().codec, "vp9");
  EXPECT_EQ(vp9.info().num_frames, 100);
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(vp9.Next());
}

}  // namespace
}  // namespace mvstudio::dataset
