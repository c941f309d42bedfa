#include "dataset/footage/video_io.h"

#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "tests/dataset/clip_writer.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

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

TEST(Frames, OnlyWantedImagesAreMade) {
  const TempDir folder;
  WriteClip(folder / "a.mp4", Regular(12));
  auto source = OpenFrames(folder / "a.mp4");
  for (int i = 0; auto frame = source->Advance(); ++i) {
    EXPECT_EQ(frame->number, i);
    EXPECT_NEAR(*frame->time_s, i / 30.0, 1e-9);
    EXPECT_TRUE(frame->rgb.empty());
    EXPECT_EQ(source->size_px(), std::pair(128, 64));
    EXPECT_TRUE(i % 5 != 0 || ReadCode(source->FullImage()) == i);
    EXPECT_EQ(source->Thumbnail(32).width, 32);
  }
}

TEST(Frames, DescribesImagesAndTheirGaps) {
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
