#include "dataset/footage/image_io.h"

#include <fstream>

#include "core/error.h"
#include "dataset/footage/frames.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

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

/// A binary PGM of 16 bits whose values lie from `low` to `high`.
void WritePgm16(const std::string& path, int low, int high) {
  std::string bytes = "P5\n# of a thermal camera\n40 30\n65535\n";
  for (int i = 0; i < 40 * 30; ++i) {
    const int value = low + (high - low) * (i % 40) / 39;
    bytes += static_cast<char>(value >> 8), bytes += static_cast<char>(value & 255);
  }
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST(ImageIo, PgmOfEightAndSixteenBits) {
  mvstudio::testing::TempDir folder;
  std::ofstream(folder / "a.pgm", std::ios::binary) << "P5 2 1 255\n" << char(7) << char(200);
  EXPECT_EQ(ReadImage(folder / "a.pgm", true).pixels, (std::vector<uint8_t>{7, 200}));
  std::ofstream(folder / "b.ppm", std::ios::binary) << "P6 1 1 255\n" << char(250) << char(20) << char(3);
  EXPECT_EQ(ReadImage(folder / "b.ppm").pixels, (std::vector<uint8_t>{250, 20, 3}));
  EXPECT_EQ(ListFootage(folder.path()).paths.size(), 2u);
  WritePgm16(folder / "c.pgm", 0, 65535);
  EXPECT_EQ(ReadImageHeader(folder / "c.pgm").bits, 16);
  const std::string all = ReadFile(folder / "c.pgm");
  for (const size_t keep : {all.size() - 1, all.size() / 2, size_t{12}, size_t{3}}) {
    std::ofstream(folder / "cut.pgm", std::ios::binary) << all.substr(0, keep);
    EXPECT_THROW(ReadImage(folder / "cut.pgm"), FormatError) << keep;
  }
}

TEST(ImageIo, FewLevelsAreStretched) {
  mvstudio::testing::TempDir folder;
  WritePgm16(folder / "few.pgm", 20000, 23000);
  WritePgm16(folder / "all.pgm", 100, 60000);
  const StretchedImage few = ReadImageStretched(folder / "few.pgm"), all = ReadImageStretched(folder / "all.pgm");
  EXPECT_NEAR(few.levels, 3001, 1);
  EXPECT_EQ(few.rgb.channels, 3);
  EXPECT_EQ(*few.rgb.Pixel(0, 3), 0);
  EXPECT_EQ(*few.rgb.Pixel(39, 3), 255);
  EXPECT_EQ(all.levels, 0) << "a range that is used is kept";
  EXPECT_NEAR(*all.rgb.Pixel(39, 3), 60000 / 257, 1);
  WriteImage(RandomImage(8, 8, 3, 1), folder / "eight.png");
  EXPECT_EQ(ReadImageStretched(folder / "eight.png").rgb.pixels, ReadImage(folder / "eight.png").pixels);
  const auto source = OpenFrames(folder / "few.pgm", {false, false, true});
  EXPECT_EQ(*source->Next()->rgb.Pixel(39, 0), 255);
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

std::string Little(uint32_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i) & 0xff);
  return text;
}
std::string Big(uint32_t value, int bytes) {
  const std::string little = Little(value, bytes);
  return {little.rbegin(), little.rend()};
}

/// TIFF's directory with the tag Orientation alone, as EXIF has it.
std::string OrientationTag(int orientation, bool big_endian) {
  const auto number = [&](uint32_t value, int bytes) { return big_endian ? Big(value, bytes) : Little(value, bytes); };
  return (big_endian ? "MM" : "II") + number(42, 2) + number(8, 4) + number(1, 2) + number(274, 2) + number(3, 2) +
         number(1, 4) + number(static_cast<uint32_t>(orientation), 2) + number(0, 2) + number(0, 4);
}

std::string JpegWith(const std::string& jpeg, const std::string& tiff) {
  const std::string exif = std::string("Exif\0\0", 6) + tiff;
  return jpeg.substr(0, 2) + "\xff\xe1" + Big(static_cast<uint32_t>(exif.size() + 2), 2) + exif + jpeg.substr(2);
}

/// CRC-32 bit by bit, as ISO 3309 defines it.
uint32_t PlainCrc(const std::string& text) {
  uint32_t crc = 0xffffffffu;
  for (const char c : text) {
    crc ^= static_cast<uint8_t>(c);
    for (int k = 0; k < 8; ++k) crc = crc & 1 ? 0xedb88320u ^ (crc >> 1) : crc >> 1;
  }
  return ~crc;
}

/// The chunk stands behind the header, or at the file's end.
std::string PngWith(const std::string& png, const std::string& tiff, bool at_end) {
  const std::string chunk = Big(static_cast<uint32_t>(tiff.size()), 4) + "eXIf" + tiff + Big(PlainCrc("eXIf" + tiff), 4);
  const size_t at = at_end ? png.size() - 12 : 33;
  return png.substr(0, at) + chunk + png.substr(at);
}

/// Grey, not compressed, in one strip.
std::string TiffOf(const Image& grey, int orientation) {
  const auto tag = [](uint32_t id, uint32_t value) { return Little(id, 2) + Little(4, 2) + Little(1, 4) + Little(value, 4); };
  const uint32_t size = static_cast<uint32_t>(grey.pixels.size());
  return "II" + Little(42, 2) + Little(8 + size, 4) + std::string(grey.pixels.begin(), grey.pixels.end()) + Little(10, 2) +
         tag(256, static_cast<uint32_t>(grey.width)) + tag(257, static_cast<uint32_t>(grey.height)) + tag(258, 8) +
         tag(259, 1) + tag(262, 1) + tag(273, 8) + tag(274, static_cast<uint32_t>(orientation)) + tag(277, 1) +
         tag(278, static_cast<uint32_t>(grey.height)) + tag(279, size) + Little(0, 4);
}

constexpr int kWidth = 48, kHeight = 32;
uint8_t LevelAt(int x, int y) { return static_cast<uint8_t>(20 + 70 * (x / 16) + 30 * (y / 16)); }

/// TIFF 6.0 on Orientation: which visual side the stored row 0 and column 0 are.
void ExpectShown(const std::string& path, int orientation) {
  const Image shown = ReadImage(path, true);
  const bool swaps = orientation >= 5;
  ASSERT_EQ(shown.width, swaps ? kHeight : kWidth) << orientation;
  ASSERT_EQ(shown.height, swaps ? kWidth : kHeight);
  EXPECT_EQ(ReadImageHeader(path).width, shown.width);
  const bool row_far = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  const bool column_far = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  for (int y = 8; y < kHeight; y += 16) {
    for (int x = 8; x < kWidth; x += 16) {
      const int along_rows = row_far ? kHeight - 1 - y : y, along_columns = column_far ? kWidth - 1 - x : x;
      const int u = swaps ? along_rows : along_columns, v = swaps ? along_columns : along_rows;
      EXPECT_NEAR(*shown.Pixel(u, v), LevelAt(x, y), 2) << path << " " << orientation << " at " << x << " " << y;
    }
  }
}

TEST(ImageIo, OrientationIsApplied) {
  const mvstudio::testing::TempDir folder;
  Image stored(kWidth, kHeight, 1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) *stored.Pixel(x, y) = LevelAt(x, y);
  }
  const std::string jpeg = EncodeImage(stored, "a.jpg"), png = EncodeImage(stored, "a.png");
  for (int orientation = 1; orientation <= 8; ++orientation) {
    for (const bool other : {false, true}) {
      const std::string tag = OrientationTag(orientation, other);
      WriteFileAtomic(folder / "a.jpg", JpegWith(jpeg, tag));
      ExpectShown(folder / "a.jpg", orientation);
      WriteFileAtomic(folder / "a.png", PngWith(png, tag, other));
      ExpectShown(folder / "a.png", orientation);
    }
    WriteFileAtomic(folder / "a.tif", TiffOf(stored, orientation));
    ExpectShown(folder / "a.tif", orientation);
  }
}

TEST(Frames, ImagesOfACameraAreRotatedAlike) {
  const mvstudio::testing::TempDir folder;
  const std::string jpeg = EncodeImage(Image(kWidth, kHeight, 1), "a.jpg");
  for (const int i : {1, 2}) {
    WriteFileAtomic(folder / ("alike/" + std::to_string(i) + ".jpg"), JpegWith(jpeg, OrientationTag(6, false)));
    WriteFileAtomic(folder / ("mixed/" + std::to_string(i) + ".jpg"), JpegWith(jpeg, OrientationTag(i == 1 ? 6 : 8, false)));
  }
  EXPECT_EQ(OpenFrames(folder / "alike")->Next()->rgb.width, kHeight);
  const FootageInfo info = DescribeFootage(folder / "alike");
  EXPECT_EQ(info.height, kWidth);
  ASSERT_EQ(info.notes.size(), 1u);
  EXPECT_EQ(info.notes[0].code, "SES-ROTATED");
  const auto mixed = OpenFrames(folder / "mixed");
  EXPECT_TRUE(mixed->Next());
  EXPECT_THROW(mixed->Next(), FormatError);
  const auto sensor = OpenFrames(folder / "mixed", {false, true});
  EXPECT_EQ(sensor->Next()->rgb.width, kWidth);
  EXPECT_EQ(sensor->Next()->rgb.width, kWidth);
  EXPECT_EQ(sensor->size_px().first, kWidth);
}

TEST(Frames, OpacityIsNamed) {
  const mvstudio::testing::TempDir folder;
  WriteImage(Image(8, 8, 4, 90), folder / "1.png");
  const FootageInfo info = DescribeFootage(folder.path());
  ASSERT_EQ(info.notes.size(), 1u);
  EXPECT_EQ(info.notes[0].code, "SES-ALPHA");
  EXPECT_EQ(ReadImage(folder / "1.png").channels, 3);
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
