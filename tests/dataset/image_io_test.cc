#include "dataset/footage/image_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/error.h"
#include "dataset/footage/frames.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

TEST(ImageIo, PngRoundTripIsExact) {
  mvstudio::testing::TempDir folder;
  for (const int channels : {1, 3}) {
    const Image image = RandomImage(37, 23, channels, 7);
    WriteImage(image, folder / "a.png");
    const Image back = ReadImage(folder / "a.png", channels == 1);
    EXPECT_EQ(back.width, 37);
    EXPECT_EQ(back.height, 23);
    EXPECT_EQ(back.pixels, image.pixels);
  }
}

TEST(ImageIo, JpegKeepsRedGreenBlueOrder) {
  mvstudio::testing::TempDir folder;
  Image image(32, 32, 3);
  for (int i = 0; i < 32 * 32; ++i) image.pixels[3 * i] = 250, image.pixels[3 * i + 1] = 100, image.pixels[3 * i + 2] = 10;
  WriteImage(image, folder / "a.jpg", 95);
  EXPECT_LT(MeanAbsDifference(ReadImage(folder / "a.jpg"), image), 1.5);
}

TEST(ImageIo, EveryTruncationIsAFormatError) {
  mvstudio::testing::TempDir folder;
  const Image image = RandomImage(40, 30, 3, 3);
  for (const std::string name : {"a.png", "a.jpg"}) {
    WriteImage(image, folder / name);
    for (int i = 0; i < 100; ++i) {
      Truncate(folder / name, folder / "cut", i / 100.0);
      EXPECT_THROW(ReadImage(folder / "cut"), FormatError) << name << " at " << i << " %";
    }
    const std::string all = ReadFile(folder / name);
    for (const size_t keep : {all.size() - 1, all.size() - 2, all.size() - 5}) {
      std::ofstream(folder / "cut", std::ios::binary) << all.substr(0, keep);
      EXPECT_THROW(ReadImage(folder / "cut"), FormatError) << name << " " << keep << " of " << all.size();
    }
  }
}

TEST(ImageIo, DamagedPngIsAFormatError) {
  mvstudio::testing::TempDir folder;
  WriteImage(RandomImage(40, 30, 3, 3), folder / "a.png");
  const std::string good = ReadFile(folder / "a.png");
  for (size_t at = 8; at + 4 < good.size(); at += 97) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    WriteFileAtomic(folder / "bad.png", bad);
    EXPECT_THROW(ReadImage(folder / "bad.png"), FormatError) << "byte " << at;
  }
}

/// A header of 11,000 x 11,000 pixels of 16 bits in front of nothing.
TEST(ImageIo, APngOutOfAllProportionIsNotDecoded) {
  const mvstudio::testing::TempDir folder;
  const std::string png("\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\x2a\xf8\0\0\x2a\xf8\x10\x02\0\0\0\0\0\0\0", 33);
  std::ofstream(folder / "a.png", std::ios::binary) << png << std::string(1000, 'x');
  EXPECT_THAT(mvstudio::testing::MessageOf<FormatError>([&] { ReadImage(folder / "a.png"); }),
              ::testing::HasSubstr("all proportion"));
}

TEST(ImageIo, ErrorsNameTheFile) {
  mvstudio::testing::TempDir folder;
  EXPECT_THROW(ReadImage(folder / "none.png"), IoError);
  WriteFileAtomic(folder / "text.png", "not a picture");
  try {
    ReadImage(folder / "text.png");
    FAIL();
  } catch (const FormatError& error) {
    EXPECT_EQ(error.path(), folder / "text.png");
  }
  EXPECT_THROW(WriteImage(Image(4, 4, 3), folder / "a.gif"), UsageError);
  EXPECT_THROW(WriteImage(Image(), folder / "a.png"), ContractViolation);
}

TEST(Frames, FolderAndPatternComeInNumericOrder) {
  mvstudio::testing::TempDir folder;
  for (const int i : {10, 2, 1})
    WriteImage(Image(8, 8, 3, static_cast<uint8_t>(i)), folder / ("image" + std::to_string(i) + ".png"));
  WriteFileAtomic(folder / "notes.txt", "x");
  for (const std::string& path : {folder.path(), folder / "image*.png"}) {
    auto source = OpenFrames(path);
    EXPECT_EQ(source->num_frames(), 3);
    for (const int expected : {1, 2, 10}) {
      const auto frame = source->Next();
      ASSERT_TRUE(frame);
      EXPECT_EQ(frame->rgb.pixels[0], expected);
      EXPECT_EQ(frame->label, "image" + std::to_string(expected) + ".png");
    }
    EXPECT_FALSE(source->Next());
  }
}

TEST(Frames, MissingAndForeignFiles) {
  mvstudio::testing::TempDir folder;
  EXPECT_THROW(OpenFrames(folder.path()), IoError);
  EXPECT_THROW(OpenFrames(folder / "none*.png"), IoError);
  EXPECT_THROW(OpenFrames(folder / "none.mp4"), IoError);
  WriteFileAtomic(folder / "text.mp4", std::string(5000, 'x'));
  EXPECT_THROW(OpenFrames(folder / "text.mp4"), FormatError);
}

}  // namespace
}  // namespace mvstudio::dataset
