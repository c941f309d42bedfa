#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/video_io.h"
#include "tests/dataset/clip_writer.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/dataset/decoded.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

/// Decoded and merely read time stamps agree with those written, and each image stands at its own time.
void ExpectTimes(const std::string& path, const std::vector<int64_t>& pts, double unit_s, double tolerance_s = 1e-9) {
  VideoReader reader(path);
  const Decoded decoded = DecodeAll(&reader);
  const VideoTimes times = ReadVideoTimes(path);
  ASSERT_EQ(decoded.codes.size(), pts.size()) << path;
  ASSERT_EQ(times.time_s.size(), pts.size()) << path;
  EXPECT_EQ(times.cut_short, "");
  const double shift = decoded.times_s[0] - static_cast<double>(pts[0]) * unit_s;  // containers may start elsewhere
  for (size_t i = 0; i < pts.size(); ++i) {
    EXPECT_EQ(decoded.codes[i], static_cast<int>(i));
    EXPECT_EQ(decoded.numbers[i], static_cast<int64_t>(i));
    EXPECT_NEAR(decoded.times_s[i], static_cast<double>(pts[i]) * unit_s + shift, tolerance_s) << path << " frame " << i;
    EXPECT_NEAR(times.time_s[i], decoded.times_s[i], 1e-9);
  }
}

TEST(VideoTimes, AreThoseOfTheFile) {
  const TempDir folder;
  std::vector<int64_t> variable{0};
  for (int i = 1; i < 40; ++i) variable.push_back(variable.back() + 1500 + 700 * (i % 7));
  ClipOptions b_frames, ten_bit;
  b_frames.b_frames = 3;
  ten_bit.ten_bit = true;
  for (const char* container : {"mp4", "mkv", "mov"}) {
    const std::string ext = container;
    const double tolerance_s = ext == "mkv" ? 6e-4 : 1e-9;  // Matroska keeps milliseconds
    WriteClip(folder / ("regular." + ext), Regular(40));
    ExpectTimes(folder / ("regular." + ext), Regular(40), 1.0 / 90000, tolerance_s);
    WriteClip(folder / ("b." + ext), Regular(40), b_frames);
    ExpectTimes(folder / ("b." + ext), Regular(40), 1.0 / 90000, tolerance_s);
    WriteClip(folder / ("variable." + ext), variable, b_frames);
    ExpectTimes(folder / ("variable." + ext), variable, 1.0 / 90000, tolerance_s);
    WriteClip(folder / ("ten." + ext), Regular(20), ten_bit);
    ExpectTimes(folder / ("ten." + ext), Regular(20), 1.0 / 90000, tolerance_s);
    EXPECT_EQ(VideoReader(folder / ("ten." + ext)).info().bits, 10);
  }
}

TEST(VideoTimes, EditListHidesWhatComesBeforeTheStart) {
  const TempDir folder;
  for (const int b_frames : {0, 2}) {
    ClipOptions options;
    options.b_frames = b_frames;
    WriteClip(folder / "cut.mp4", Regular(30, 3000, -15000), options);
    VideoReader reader(folder / "cut.mp4");
    const Decoded decoded = DecodeAll(&reader);
    const VideoTimes times = ReadVideoTimes(folder / "cut.mp4");
    ASSERT_EQ(decoded.codes.size(), 25u);
    ASSERT_EQ(times.time_s.size(), 25u);
    for (int i = 0; i < 25; ++i) {
      EXPECT_EQ(decoded.codes[i], i + 5);
      EXPECT_NEAR(decoded.times_s[i], i / 30.0, 1e-9);
      EXPECT_NEAR(times.time_s[i], i / 30.0, 1e-9);
    }
  }
}

/// Bytes of the movie's header set to 0: `at` from the box's name on.
std::string WithZeros(std::string bytes, const std::string& box, size_t at) {
  const size_t found = bytes.find(box);
  EXPECT_NE(found, std::string::npos);
  return bytes.replace(found + at, 4, 4, '\0');
}

TEST(VideoTimes, AClockThatCannotBeIsRefused) {
  const TempDir folder;
  WriteClip(folder / "a.mp4", Regular(12));
  const std::string bytes = ReadFile(folder / "a.mp4");
  std::ofstream(folder / "scale.mp4", std::ios::binary) << WithZeros(bytes, "mdhd", 16);
  std::string stamps = bytes;
  const size_t table = stamps.find("stts");
  for (int i = 0; i < stamps[table + 11]; ++i) stamps.replace(table + 16 + 8 * static_cast<size_t>(i), 4, 4, '\0');
  std::ofstream(folder / "stamps.mp4", std::ios::binary) << stamps;
  for (const auto& [name, said] : {std::pair("scale", "time scale is 0"), std::pair("stamps", "12 frames all have one time")}) {
    const std::string path = folder / (std::string(name) + ".mp4");
    EXPECT_THAT(mvstudio::testing::MessageOf<FormatError>([&] { VideoReader reader(path); }), ::testing::HasSubstr(said));
    EXPECT_THAT(mvstudio::testing::MessageOf<FormatError>([&] { ReadVideoTimes(path); }), ::testing::HasSubstr(said));
  }
}

}  // namespace
}  // namespace mvstudio::dataset
