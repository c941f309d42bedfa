#include "dataset/footage/video_io.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "tests/dataset/clip_writer.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

using mvstudio::testing::ClipOptions;
using mvstudio::testing::ClipWriter;
using mvstudio::testing::ReadCode;
using mvstudio::testing::Regular;
using mvstudio::testing::TempDir;
using mvstudio::testing::WriteClip;

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
  for (const int width : {64, 80, 144}) {  // an encoder of the system differed there
    WriteVideo(folder / "a.mp4", width, 48, 12, 16, false);
    const std::string first = ReadFile(folder / "a.mp4");
    for (int run = 0; run < 5; ++run) {
      WriteVideo(folder / "b.mp4", width, 48, 12, 16, false);
      EXPECT_TRUE(ReadFile(folder / "b.mp4") == first) << "width " << width << ", run " << run;
    }
  }
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

/// A file of `text` called like a video; the message with which it is refused.
std::string RefusedAs(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
  return mvstudio::testing::MessageOf<FormatError>([&] { VideoReader reader(path); });
}

// A playlist's parts may lie anywhere, and be fetched from anywhere.
TEST(VideoIo, PlaylistsAndDescriptionsAreNoVideos) {
  const TempDir folder;
  const std::string video = folder / "private.mp4";
  WriteClip(video, Regular(8));
  ASSERT_EQ(VideoReader(video).info().num_frames, 8);
  const std::string hls = "#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:1\n#EXTINF:1.0,\nprivate.mp4\n#EXT-X-ENDLIST\n";
  const std::pair<const char*, std::string> lists[] = {
      {"hls", hls},
      {"concat", "ffconcat version 1.0\nfile private.mp4\n"},
      {"sdp", "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 5004 RTP/AVP 96\n"}};
  for (const auto& [kind, text] : lists) {
    for (const char* name : {"cam_01.mp4", "cam_01.m3u8", "cam_01"}) {
      const std::string said = RefusedAs(folder / name, text);
      EXPECT_NE(said.find(std::string("is of the kind '") + kind + "'"), std::string::npos) << said;
      EXPECT_EQ(said.rfind(folder / name, 0), 0u) << said;
      EXPECT_EQ(said.find('\n'), std::string::npos) << said;
    }
  }
  WriteImage(Image(16, 16, 3), folder / "p_1.png");
  std::filesystem::rename(folder / "p_1.png", folder / "cam_%d.mp4");
  EXPECT_THROW(VideoReader(folder / "cam_%d.mp4"), FormatError) << "a pattern of pictures";
  EXPECT_NE(RefusedAs(folder / "text.mp4", "no video at all\n").find("is not a video that can be opened"), std::string::npos);
}

TEST(VideoIo, WhatCamerasWriteIsRead) {
  const TempDir folder;
  for (const std::string extension : {"mp4", "mov", "mkv", "avi", "ts", "m2ts", "flv", "h264", "mxf", "nut"}) {
    ClipOptions options;
    if (extension == "mxf") options.time_base = {1, 25};
    const std::string path = folder / ("a." + extension);
    WriteClip(path, Regular(8, extension == "mxf" ? 1 : 3000), options);
    VideoReader reader(path);
    ASSERT_TRUE(reader.Next()) << extension;
    EXPECT_EQ(reader.info().codec, "h264") << extension;
  }
}

TEST(VideoIo, PipesAndDevicesAreRefused) {
  const TempDir folder;
  ASSERT_EQ(mkfifo((folder / "a.mp4").c_str(), 0600), 0);
  ASSERT_EQ(mkfifo((folder / "a.png").c_str(), 0600), 0);
  const auto said = [](const std::string& path) {
    return mvstudio::testing::MessageOf<IoError>([&] { OpenFrames(path)->Advance(); });
  };
  for (const std::string& path : {folder / "a.mp4", folder / "a.png", folder / "*.png"})
    EXPECT_NE(said(path).find("is a named pipe, a regular file was expected"), std::string::npos) << said(path);
  EXPECT_NE(said("/dev/zero").find("is a device"), std::string::npos);
  EXPECT_THROW(ReadImage(folder / "a.png"), IoError);
  EXPECT_THROW(ReadImageHeader(folder / "a.png"), IoError);
  EXPECT_THROW(ReadVideoTimes(folder / "a.mp4"), IoError);
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

struct Decoded {
  std::vector<int> codes;
  std::vector<int64_t> numbers;
  std::vector<double> times_s;
};

Decoded DecodeAll(VideoReader* reader) {
  Decoded decoded;
  while (const auto image = reader->Next()) {
    decoded.codes.push_back(ReadCode(*image));
    decoded.numbers.push_back(reader->frame_idx());
    decoded.times_s.push_back(reader->time_s());
  }
  return decoded;
}

/// Decoded and merely read time stamps agree with those written, and each picture stands at its own time.
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

TEST(VideoIo, RotationIsApplied) {
  const TempDir folder;
  for (const int deg : {90, 180, 270}) {
    ClipOptions options;
    options.clockwise_deg = deg;
    WriteClip(folder / "turned.mp4", Regular(3), options, {1, 1, 1});
    VideoReader reader(folder / "turned.mp4");
    EXPECT_EQ(reader.info().quarter_turns_clockwise, deg / 90);
    EXPECT_EQ(reader.info().width, deg == 180 ? 128 : 64);
    const auto image = reader.Next();
    ASSERT_TRUE(image);
    ASSERT_EQ(image->width, reader.info().width);
    // The white bar stands at the left edge of the coded picture.
    const auto white = [&](int x, int y) { return image->Pixel(x, y)[0] > 127; };
    EXPECT_EQ(white(image->width / 2, 3), deg == 90) << deg;
    EXPECT_EQ(white(image->width - 4, image->height / 2), deg == 180) << deg;
    EXPECT_EQ(white(image->width / 2, image->height - 4), deg == 270) << deg;
  }
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

TEST(VideoIo, SizesBeyondTheLimitAreRefused) {
  const TempDir folder;
  WriteClip(folder / "a.mp4", Regular(3));
  EXPECT_THROW(VideoReader(folder / "a.mp4", {false, 100}), FormatError);
  std::string huge = ReadFile(folder / "a.mp4");
  const size_t entry = huge.find("avc1", huge.find("stsd"));
  ASSERT_NE(entry, std::string::npos);
  huge.replace(entry + 28, 4, "\xff\xff\xff\xff", 4);  // 65535 x 65535, the most that the header can say
  WriteFileAtomic(folder / "huge.mp4", huge);
  const std::string text = mvstudio::testing::MessageOf<FormatError>([&] { VideoReader reader(folder / "huge.mp4"); });
  EXPECT_NE(text.find("65535x65535"), std::string::npos) << text;
  WriteClip(folder / "tiny.mkv", Regular(2), [] {
    ClipOptions tiny;
    tiny.codec = "mjpeg", tiny.width = tiny.height = 1;
    return tiny;
  }());
  const auto image = VideoReader(folder / "tiny.mkv").Next();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->width * image->height, 1);
}

TEST(VideoIo, PictureSizeThatChangesIsRefused) {
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

TEST(Frames, OnlyWantedPicturesAreMade) {
  const TempDir folder;
  WriteClip(folder / "a.mp4", Regular(12));
  auto source = OpenFrames(folder / "a.mp4");
  for (int i = 0; auto frame = source->Advance(); ++i) {
    EXPECT_EQ(frame->number, i);
    EXPECT_NEAR(*frame->time_s, i / 30.0, 1e-9);
    EXPECT_TRUE(frame->rgb.empty());
    EXPECT_EQ(source->size_px(), std::pair(128, 64));
    EXPECT_TRUE(i % 5 != 0 || ReadCode(source->Picture()) == i);
    EXPECT_EQ(source->Thumbnail(32).width, 32);
  }
}

TEST(Frames, DescribesPicturesAndTheirGaps) {
  const TempDir folder;
  for (const int i : {3, 4, 7, 12}) WriteImage(Image(8, 6, 3, 9), folder / ("p" + std::to_string(i) + ".png"));
  WriteImage(Image(8, 6, 3, 9), folder / "p007.png");
  const FootageInfo info = DescribeFootage(folder.path());
  EXPECT_EQ(info.num_frames, 5);
  EXPECT_EQ(info.codec, "png");
  EXPECT_EQ(info.width, 8);
  EXPECT_EQ(info.gaps, (std::vector<std::pair<int64_t, int64_t>>{{5, 6}, {8, 11}}));
  EXPECT_EQ(info.twice, std::vector<int64_t>{7});
}

}  // namespace
}  // namespace mvstudio::dataset
