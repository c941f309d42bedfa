#include <fstream>

#include "core/error.h"
#include "dataset/session/timeline_source.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Tables of times whose columns do not say all: the unit, or dates for numbers.
namespace mvstudio::dataset {
namespace {

struct ReadTimes {
  std::vector<double> time_s;
  std::vector<std::string> notes;
};

/// Five frames of camera `a`, of a video of its own times where these have a step.
ReadTimes ReadTable(const std::string& column, const std::vector<std::string>& times, double video_step = 0) {
  const testing::TempDir folder;
  std::ofstream out(folder / "t.csv");
  out << "camera,frame," << column << "\n";
  for (size_t k = 0; k < times.size(); ++k) out << "a," << k << "," << times[k] << "\n";
  out.close();
  std::vector<CameraTimes> cameras = {{"a", "", {0, 1, 2, 3, 4}, {0, 0, 0, 0, 0}, {}, std::nullopt}};
  if (video_step > 0) {
    cameras[0].source = "a.mp4";
    for (size_t k = 0; k < 5; ++k) cameras[0].time_s[k] = video_step * static_cast<double>(k);
  }
  ReadTimes read;
  read.notes = ReadTimestamps(folder / "t.csv", {{"a", "", "", 0, 0}}, &cameras);
  read.time_s = cameras[0].time_s;
  return read;
}

TEST(TimestampUnits, WhatNoColumnStatesIsTheOneOfACamera) {
  const ReadTimes ms = ReadTable("timestamp", {"1000", "1033.25", "1066.5", "1133", "1166.25"});
  EXPECT_NEAR(ms.time_s[3] - ms.time_s[0], 0.133, 1e-9);
  ASSERT_EQ(ms.notes.size(), 1u);
  EXPECT_THAT(ms.notes[0], HasSubstr("`timestamp` of times names no unit: taken as ms, which makes 30.08 frames a second"));
  const ReadTimes us = ReadTable("time", {"5000", "10000", "15000", "20000", "25000"});
  for (size_t k = 0; k < 5; ++k) EXPECT_NEAR(us.time_s[k], 0.005 * static_cast<double>(k + 1), 1e-12);
  EXPECT_THAT(us.notes[0], HasSubstr("as us, which makes 200 frames"));
  const ReadTimes ns = ReadTable("frame_time", {"1700000000000000000", "1700000000040000000", "1700000000080000000",
                                                "1700000000120000000", "1700000000160000000"});
  EXPECT_NEAR(ns.time_s[4] - ns.time_s[0], 0.16, 1e-6);
  EXPECT_THAT(ns.notes[0], HasSubstr("as ns"));
}

TEST(TimestampUnits, SecondsAndStatedUnitsStay) {
  const ReadTimes seconds = ReadTable("timestamp", {"10", "11", "12", "13", "14"});
  EXPECT_EQ(seconds.time_s[4], 14) << "one image a second";
  EXPECT_THAT(seconds.notes, IsEmpty());
  const ReadTimes stated = ReadTable("time_s", {"0", "60", "120", "180", "240"});
  EXPECT_EQ(stated.time_s[4], 240) << "an image a minute, as the column says";
  EXPECT_THAT(stated.notes, IsEmpty());
}

/// Two seconds a photo are as likely as two milliseconds a frame: the word is seconds, and it is said.
TEST(TimestampUnits, TimeLapsesStayAndTheVideosRateDecides) {
  const std::vector<std::string> two = {"0", "2", "4", "6", "8"}, thousand = {"0", "1000", "2000", "3000", "4000"};
  const ReadTimes lapse = ReadTable("timestamp", two);
  EXPECT_EQ(lapse.time_s[4], 8);
  ASSERT_EQ(lapse.notes.size(), 1u);
  EXPECT_THAT(lapse.notes[0], HasSubstr("taken as s, which makes 0.5 frames a second; call it time_ms"));
  EXPECT_NEAR(ReadTable("timestamp", two, 0.002).time_s[4], 0.008, 1e-12) << "500 frames a second, as the video has";
  EXPECT_EQ(ReadTable("timestamp", two, 1.0 / 30).time_s[4], 8) << "a time-lapse that plays at 30 Hz";
  EXPECT_NEAR(ReadTable("time", thousand, 0.001).time_s[4], 0.004, 1e-12);
  EXPECT_NEAR(ReadTable("time", thousand, 1).time_s[4], 4, 1e-12);
  const std::string why = testing::MessageOf<FormatError>([&] { ReadTable("time", thousand); });
  EXPECT_THAT(why, HasSubstr("name the column time_s, time_ms or time_us")) << "1 or 1000 frames a second";
}

TEST(TimestampUnits, Dates) {
  const ReadTimes dates =
      ReadTable("timestamp", {"2024-02-29T23:59:59.900", "2024-03-01 00:00:00.000Z", "2024-03-01T00:00:00.1",
                              "2024-03-01T02:00:00.2+02:00", "2024-02-29T23:30:00.3-00:30"});
  const double midnight = 1709251200;  // date -u -d 2024-03-01 +%s
  EXPECT_THAT(dates.notes, IsEmpty());
  const std::vector<double> after = {-0.1, 0, 0.1, 0.2, 0.3};
  for (size_t k = 0; k < 5; ++k) EXPECT_NEAR(dates.time_s[k] - midnight, after[k], 1e-6) << k;
}

}  // namespace
}  // namespace mvstudio::dataset
