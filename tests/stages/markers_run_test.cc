#include <filesystem>

#include "core/error.h"
#include "dataset/pose/pose3d.h"
#include "dataset/pose/pose3d_trc.h"
#include "stages/markers/describe.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

/// Two points that move by 1 mm a frame; the second is away in frames 10 to 12.
std::string Walk(const TempDir& folder) {
  dataset::Pose3d pose;
  pose.skeleton = "points", pose.frame_rate_hz = 50;
  for (int f = 0; f < 40; ++f) {
    for (const char* joint : {"snout", "tail"}) {
      dataset::JointRow& row = pose.rows.emplace_back();
      row.frame = f, row.joint = joint;
      if (joint[0] == 't' && f >= 10 && f <= 12) continue;
      row.status = Status::kOk, row.num_views = 3;
      row.x_in_world = {0.001 * f, joint[0] == 't' ? 0.2 : 0.1, 0.05};
    }
  }
  dataset::WritePose3d(pose, folder / "points");
  return folder / "points";
}

/// The line is the truth: what was filled lies on it.
TEST(MarkersStage, AGapIsFilledWhereThePointWent) {
  const TempDir folder;
  MarkersOptions options;
  options.points.path = Walk(folder), options.out = folder / "out";
  options.how.to = "trc", options.how.fill_frames = 5;
  const MarkersReport report = RunMarkers(options);
  EXPECT_EQ(report.options.how.rate_hz, 50);
  EXPECT_THAT(report.notes.inputs, ElementsAre(options.points.path));
  for (const dataset::JointRow& row : dataset::ReadTrc(folder / "out/person0.trc").rows) {
    ASSERT_EQ(row.status, Status::kOk);
    EXPECT_NEAR(row.x_in_world.x(), 0.001 * row.frame, 1e-5) << row.joint << " " << row.frame;
  }
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.folder, options.out);
  EXPECT_EQ(said.metrics["markers"]["persons"][0]["positions_filled"], 3);
}

TEST(MarkersStage, ConvertedSaysWhatTheFormatDoesNotHold) {
  const TempDir folder;
  MarkerConvertOptions options;
  options.points.path = Walk(folder), options.out = folder / "a.c3d";
  const MarkerConvertReport report = RunMarkerConvert(options);
  EXPECT_EQ(report.written.format, "c3d");
  ASSERT_EQ(report.written.persons.size(), 1u);
  EXPECT_EQ(report.written.persons[0].num_markers, 2);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.folder, "") << "a file alone";
  EXPECT_EQ(said.outputs.at(0).path, options.out);
  EXPECT_THAT(said.text, HasSubstr("a c3d does not hold digits beyond single precision"));
  options.points = {}, options.points.path = folder / "a.c3d", options.out = folder / "b.trc";
  const CommandResult back = Describe(RunMarkerConvert(options));
  EXPECT_THAT(back.text, HasSubstr("read in mm, z up, 50 frames a second"));
  EXPECT_EQ(back.metrics["converted"]["unit"], "mm");
}

TEST(MarkersStage, EventsOfWhatHasNoLegsSayWhy) {
  const TempDir folder;
  MarkersOptions options;
  options.points.path = Walk(folder), options.out = folder / "events";
  const MarkerEventsReport report = RunMarkerEvents(options);
  ASSERT_EQ(report.persons.size(), 1u);
  EXPECT_EQ(report.persons[0].file, "");
  const CommandResult said = Describe(report);
  EXPECT_TRUE(said.metrics["gait"]["persons"][0].contains("why_none"));
  EXPECT_THAT(said.text, HasSubstr("person 0: no gait events: both hips"));
}

TEST(MarkersStage, PlacesAreAskedForBeforeAnythingIsRead) {
  const TempDir folder;
  MarkerConvertOptions options;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunMarkerConvert(options); }), HasSubstr("name the points"));
  options.points.path = folder / "nowhere";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunMarkerConvert(options); }), HasSubstr("option 'out' is required"));
  options.out = folder / "m";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunMarkerConvert(options); }), HasSubstr("option 'to' is needed"));
  EXPECT_FALSE(std::filesystem::exists(options.out));
}

}  // namespace
}  // namespace mvstudio::stages
