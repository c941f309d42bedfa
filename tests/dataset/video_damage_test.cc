#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/video_io.h"
#include "tests/dataset/clip_writer.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/dataset/decoded.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

/// A video cut anywhere: every frame that is returned is the right one under the right number, the others are all listed.
void ExpectSoundAndListed(const std::string& path, int total, bool counts, int* returned) {
  VideoReader reader(path, {true, 0});
  const Decoded decoded = DecodeAll(&reader);
  *returned = static_cast<int>(decoded.codes.size());
  std::vector<bool> there(static_cast<size_t>(total), false);
  for (size_t i = 0; i < decoded.codes.size(); ++i) {
    EXPECT_EQ(decoded.codes[i], decoded.numbers[i]) << path;
    there[static_cast<size_t>(decoded.numbers[i])] = true;
  }
  int64_t listed = 0;
  for (const auto& [first, last] : reader.damage().missing) {
    for (int64_t k = first; k <= last; ++k, ++listed) EXPECT_FALSE(there[static_cast<size_t>(k)]) << "frame " << k;
  }
  EXPECT_EQ(listed, reader.damage().num_missing);
  EXPECT_TRUE(!counts || listed + *returned == total) << path << ": " << listed << " listed, " << *returned << " returned";
  EXPECT_TRUE(*returned == total || reader.damage().any()) << path;
}

TEST(VideoDamage, TruncatedFilesGiveTheirSoundFramesAndListTheRest) {
  const TempDir folder;
  for (const int b_frames : {0, 3}) {
    ClipOptions options;
    options.b_frames = b_frames;
    WriteClip(folder / "a.mp4", Regular(60), options);
    int most = 0;
    for (int percent = 40; percent < 100; percent += 6) {
      Truncate(folder / "a.mp4", folder / "cut.mp4", percent / 100.0);
      int returned = 0;
      ExpectSoundAndListed(folder / "cut.mp4", 60, true, &returned);
      EXPECT_GE(returned, most) << percent;
      most = std::max(most, returned);
    }
    EXPECT_GT(most, 40);
  }
}

TEST(VideoDamage, DamageInTheMiddleCostsTheFramesUntilTheNextKeyFrameOnly) {
  const TempDir folder;
  ClipOptions options;
  options.b_frames = 2;
  options.gop = 10;
  WriteClip(folder / "a.mp4", Regular(80), options);
  const std::string sound = ReadFile(folder / "a.mp4");
  const auto places = mvstudio::testing::PacketPlaces(folder / "a.mp4");
  ASSERT_EQ(places.size(), 80u);
  for (size_t packet = 3; packet < 80; packet += 7) {  // whole packets: one whose end alone is lost can still be valid H.264
    std::string bad = sound;
    std::fill_n(bad.begin() + places[packet].first, places[packet].second, '\0');
    WriteFileAtomic(folder / "bad.mp4", bad);
    int returned = 0;
    ExpectSoundAndListed(folder / "bad.mp4", 80, true, &returned);
    EXPECT_GE(returned, 66) << "packet " << packet;
    EXPECT_LT(returned, 80) << "packet " << packet;
  }
}

TEST(VideoDamage, ChecksumsFindEveryFlippedBitOfFfv1) {
  const TempDir folder;
  ClipOptions options;
  options.codec = "ffv1";
  options.gop = 1;
  WriteClip(folder / "a.mkv", Regular(24), options);
  const std::string sound = ReadFile(folder / "a.mkv");
  const auto places = mvstudio::testing::PacketPlaces(folder / "a.mkv");
  ASSERT_EQ(places.size(), 24u);
  mvstudio::Rng rng(4);
  for (int round = 0; round < 40; ++round) {
    std::string bad = sound;
    const auto& [at, size] = places[static_cast<size_t>(1 + rng.Index(23))];  // the first one tells that there are checksums
    bad[static_cast<size_t>(at) + 16 + rng.Index(size - 16)] ^= 4;
    WriteFileAtomic(folder / "bad.mkv", bad);
    int returned = 0;
    ExpectSoundAndListed(folder / "bad.mkv", 24, true, &returned);
    EXPECT_EQ(returned, 23) << "round " << round;
    EXPECT_THROW(
        {
          VideoReader reader(folder / "bad.mkv");
          while (reader.Next()) {
          }
        },
        FormatError);
  }
}

TEST(VideoDamage, EmptyHeaderOnlyAndIndexCutOff) {
  const TempDir folder;
  ClipOptions options;
  options.index_first = false;
  WriteClip(folder / "a.mp4", Regular(20), options);
  Truncate(folder / "a.mp4", folder / "no_index.mp4", 0.9);
  WriteClip(folder / "b.mp4", Regular(20));
  Truncate(folder / "b.mp4", folder / "header.mp4", 0.02);
  WriteFileAtomic(folder / "empty.mp4", "");
  for (const char* name : {"no_index.mp4", "header.mp4", "empty.mp4"}) {
    for (const bool keep : {false, true}) {
      EXPECT_THROW(VideoReader(folder / name, {keep, 0}), FormatError) << name;
    }
    EXPECT_THROW(ReadVideoTimes(folder / name), FormatError) << name;
  }
}

TEST(VideoIo, ImageSizeThatChangesIsRefused) {
  const TempDir folder;
  ClipOptions small, large;
  small.codec = large.codec = "mjpeg";
  large.width = 192;
  WriteClip(folder / "a.mkv", Regular(5), small);
  WriteClip(folder / "b.mkv", Regular(5), large);
  // Motion JPEG frames are whole JPEG files: the larger ones behind the smaller ones.
  WriteFileAtomic(folder / "both.mjpeg", [&] {
    std::string all;
    for (const char* name : {"a.mkv", "b.mkv"}) {
      const std::string file = ReadFile(folder / name);
      for (size_t at = 0; (at = file.find("\xff\xd8\xff", at)) != std::string::npos;) {
        const size_t end = file.find("\xff\xd9", at) + 2;
        all += file.substr(at, end - at);
        at = end;
      }
    }
    return all;
  }());
  VideoReader reader(folder / "both.mjpeg");
  const std::string text = mvstudio::testing::MessageOf<FormatError>([&] {
    while (reader.Next()) {
    }
  });
  EXPECT_NE(text.find("frame 5"), std::string::npos) << text;
  EXPECT_NE(text.find("192x64"), std::string::npos) << text;
}

}  // namespace
}  // namespace mvstudio::dataset
