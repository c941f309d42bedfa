#include "dataset/footage/chapters.h"

#include <filesystem>

#include "core/error.h"
#include "dataset/footage/frames.h"
#include "dataset/session/timeline_source.h"
#include "tests/dataset/clip_writer.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

TEST(Chapters, GoProsNames) {
  const auto text = [](const char* path) {
    const auto chapter = ChapterOf(path);
    return chapter ? chapter->recording + " " + std::to_string(chapter->number) : "none";
  };
  EXPECT_EQ(text("a/GX010123.MP4"), "GX0123 1");
  EXPECT_EQ(text("GH990123.mp4"), "GH0123 99");
  EXPECT_EQ(text("GOPR0042.MP4"), "GOPR0042 1");
  EXPECT_EQ(text("GP010042.MP4"), "GOPR0042 2");
  for (const char* other : {"GX000123.MP4", "GX010123.LRV", "GXAA0123.MP4", "GL010123.MP4", "GX01012.MP4", "board.mp4", "",
                            "GX0101234.MP4", "GOPRO042.MP4"})
    EXPECT_EQ(text(other), "none") << other;
  EXPECT_EQ(ChapterPattern("raw/b/GX020123.MP4"), "raw/b/GX??0123.MP4");
  EXPECT_EQ(ChapterPattern("GOPR0042.mp4"), "G???0042.mp4");
  EXPECT_EQ(ChapterPattern("raw/b/cam.mp4"), "raw/b/cam.mp4");
}

TEST(Chapters, AreOrderedByNumberAndNoneMayBeMissing) {
  const auto order = [](std::vector<std::string> files) { return InChapterOrder("p", std::move(files)); };
  EXPECT_THAT(order({"GP010042.MP4", "GP020042.MP4", "GOPR0042.MP4"}),
              ::testing::ElementsAre("GOPR0042.MP4", "GP010042.MP4", "GP020042.MP4"));
  EXPECT_THAT(MessageOf<FormatError>([&] {
                order({"GX010123.MP4", "GX030123.MP4"});
              }),
              HasSubstr("chapter 2 of the recording is missing"));
  EXPECT_THAT(MessageOf<FormatError>([&] { order({"GX020123.MP4", "GX030123.MP4"}); }), HasSubstr("chapter 1"));
  EXPECT_THAT(MessageOf<FormatError>([&] { order({"GX010123.MP4", "GX010124.MP4"}); }), HasSubstr("not the chapters of one"));
  EXPECT_THAT(MessageOf<FormatError>([&] { order({"a.mp4", "b.mp4"}); }), HasSubstr("not the chapters of one"));
}

TEST(Chapters, MissingOnesAreNamed) {
  using Names = std::vector<std::string>;
  EXPECT_EQ(MissingChapters({"a/GX020001.MP4"}), Names{"GX010001.MP4"});
  EXPECT_EQ(MissingChapters({"GH040123.MP4", "GH020123.MP4"}), (Names{"GH010123.MP4", "GH030123.MP4"}));
  EXPECT_EQ(MissingChapters({"GP020042.mp4"}), (Names{"GOPR0042.mp4", "GP010042.mp4"}));
  EXPECT_EQ(MissingChapters({"GOPR0042.MP4", "GP010042.MP4"}), Names());
  EXPECT_EQ(MissingChapters({"board.mp4"}), Names());
  EXPECT_EQ(MissingChapters({}), Names());
}

/// Two chapters of 10 and 7 frames at 30 Hz whose images carry 0 to 16; each file's time begins at 0.
std::string PutChapters(const TempDir& folder) {
  const auto clip = [&](const char* name, int first, int count) {
    std::vector<int64_t> pts;
    std::vector<int> codes;
    for (int i = 0; i < count; ++i) pts.push_back(3000 * i), codes.push_back(first + i);
    WriteClip(folder / name, pts, {}, codes);
  };
  clip("GX010123.MP4", 0, 10);
  clip("GX020123.MP4", 10, 7);
  return folder / "GX??0123.MP4";
}

TEST(Chapters, AreOneVideo) {
  const TempDir folder;
  const std::string pattern = PutChapters(folder);
  const auto source = OpenFrames(pattern);
  EXPECT_EQ(source->num_frames(), 17);
  for (int i = 0; i < 17; ++i) {
    const auto frame = source->Next();
    ASSERT_TRUE(frame) << i;
    EXPECT_EQ(frame->number, i);
    EXPECT_EQ(frame->label, "frame " + std::to_string(i));
    EXPECT_NEAR(*frame->time_s, i / 30.0, 1e-9);
    EXPECT_EQ(ReadCode(frame->rgb), i);
  }
  EXPECT_FALSE(source->Next());
  EXPECT_FALSE(source->Next());
  const FootageInfo info = DescribeFootage(pattern);
  EXPECT_TRUE(info.is_video);
  EXPECT_EQ(info.num_frames, 17);
  EXPECT_EQ(info.files.size(), 2u);
  const CameraTimes times = ReadFootageTimes("a", pattern, 30);
  ASSERT_EQ(times.time_s.size(), 17u);
  for (int i = 0; i < 17; ++i) EXPECT_NEAR(times.time_s[static_cast<size_t>(i)], i / 30.0, 1e-9);
}

TEST(Chapters, DamageKeepsTheNumbersOfLaterFiles) {
  const TempDir folder;
  const std::string pattern = PutChapters(folder);
  ClipOptions small;
  small.width = 64;
  WriteClip(folder / "GX030123.MP4", {0, 3000}, small);
  EXPECT_THAT(MessageOf<FormatError>([&] { OpenFrames(pattern); }), HasSubstr("another size"));
  std::filesystem::remove(folder / "GX030123.MP4");
  const std::string first = folder / "GX010123.MP4";
  std::filesystem::resize_file(first, std::filesystem::file_size(first) - 200);  // the index comes first
  const auto source = OpenFrames(pattern, {true});
  std::vector<int64_t> numbers;
  while (const auto frame = source->Next()) {
    numbers.push_back(frame->number);
    EXPECT_EQ(ReadCode(frame->rgb), frame->number);
  }
  ASSERT_FALSE(numbers.empty());
  EXPECT_LT(numbers.size(), 17u);
  EXPECT_EQ(numbers.back(), 16);
  EXPECT_FALSE(source->Damage().empty());
}

/// Times of 60 frames at 30 Hz whose file has this time code.
CameraTimes Coded(const TempDir& folder, const std::string& camera, const std::string& code) {
  ClipOptions options;
  options.time_code = code;
  std::vector<int64_t> pts;
  for (int i = 0; i < 60; ++i) pts.push_back(3000 * i);
  const std::string path = folder / (camera + ".mov");
  WriteClip(path, pts, options);
  return ReadFootageTimes(camera, path, 30);
}

TEST(TimeCodes, PlaceTheCamerasOnOneClock) {
  const TempDir folder;
  std::vector<CameraTimes> times = {Coded(folder, "a", "10:00:00:20"), Coded(folder, "b", "10:00:01:05"),
                                    Coded(folder, "c", "10:00:00:20")};
  ASSERT_TRUE(times[1].time_code_s);
  EXPECT_NEAR(*times[1].time_code_s, 36001 + 5 / 30.0, 1e-6);
  ASSERT_TRUE(PlaceByTimeCodes(&times));
  const Timeline timeline = BuildTimeline(times, TimelineClock::kCommon, nullptr);
  EXPECT_EQ(timeline.Find("b")->frame_at.at(15), 0);  // b began 15 frames later
  EXPECT_EQ(timeline.Find("b")->frame_at.at(14), -1);
  EXPECT_EQ(timeline.Find("c")->frame_at.at(0), 0);
  EXPECT_NEAR(timeline.Find("b")->offset_frames, -15, 1e-6);
}

TEST(TimeCodes, MidnightIsNoDayApart) {
  const TempDir folder;
  std::vector<CameraTimes> times = {Coded(folder, "a", "23:59:59:25"), Coded(folder, "b", "00:00:00:10")};
  ASSERT_TRUE(PlaceByTimeCodes(&times));
  EXPECT_NEAR(times[1].time_s[0] - times[0].time_s[0], 0.5, 1e-6);
}

TEST(TimeCodes, AreNotUsedUnlessAllHaveThemAndTheyMeet) {
  const TempDir folder;
  std::vector<CameraTimes> one_without = {Coded(folder, "a", "10:00:00:00"), Coded(folder, "b", "")};
  EXPECT_FALSE(one_without[1].time_code_s);
  const std::vector<double> before = one_without[0].time_s;
  EXPECT_FALSE(PlaceByTimeCodes(&one_without));
  EXPECT_EQ(one_without[0].time_s, before);
  std::vector<CameraTimes> apart = {Coded(folder, "c", "10:00:00:00"), Coded(folder, "d", "11:00:00:00")};
  EXPECT_FALSE(PlaceByTimeCodes(&apart)) << "they filmed at other times";
}

}  // namespace
}  // namespace mvstudio::dataset
