#include "stages/dataset/session_table.h"

#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

dataset::InspectedFootage Footage(const std::string& camera, bool sound, bool video) {
  dataset::InspectedFootage footage;
  footage.take = "walk", footage.camera = camera, footage.path = "raw/walk/" + camera;
  footage.sound = sound, footage.num_frames = 250, footage.duration_s = 10;
  footage.info.emplace();
  footage.info->is_video = video, footage.info->codec = video ? "h264" : "png";
  footage.info->width = 1920, footage.info->height = 1080, footage.info->fps_hz = video ? 25 : 0;
  footage.info->turn.quarter_turns_clockwise = 1;
  return footage;
}

/// A sound video, damaged images with a gap, and what cannot be opened.
dataset::SessionReport Report() {
  dataset::SessionReport report;
  report.footage = {Footage("left", true, true), Footage("right", false, false), {}};
  report.footage[1].info->gaps = {{3, 5}};
  report.footage[2].take = "walk", report.footage[2].camera = "top", report.footage[2].path = "raw/walk/top.avi";
  return report;
}

std::string LineOf(const std::string& text, const std::string& words) {
  const size_t at = text.find(words);
  if (at == std::string::npos) return "no line";
  const size_t begin = text.rfind('\n', at) + 1;
  return text.substr(begin, text.find('\n', at) - begin);
}

TEST(SessionTable, EachCamerasFootageHasALine) {
  const std::string text = FootageText(Report());
  EXPECT_THAT(LineOf(text, "left"), HasSubstr("1920x1080"));
  EXPECT_THAT(LineOf(text, "left"), HasSubstr("25.000"));
  EXPECT_THAT(LineOf(text, "left"), HasSubstr("10.00"));
  EXPECT_THAT(LineOf(text, "left"), Not(HasSubstr("damaged")));
  EXPECT_THAT(LineOf(text, "right"), HasSubstr("raw/walk/right  (damaged)"));
  EXPECT_THAT(LineOf(text, "top"), HasSubstr("cannot be read: raw/walk/top.avi"));
}

TEST(SessionTable, TheExitCodeTellsHowMuchIsSound) {
  const Notice warning{"SES-KEY", "unknown key", "see"}, error{"SES-MISSING", "gone", "copy", true};
  const auto result_of = [](const std::vector<bool>& sound, const std::vector<Notice>& findings) {
    dataset::SessionReport report;
    for (const bool s : sound) report.footage.push_back(Footage("a", s, true));
    report.findings = findings;
    return DescribeFootageFindings(report);
  };
  EXPECT_EQ(result_of({true, true}, {}).exit, kExitOk);
  EXPECT_EQ(result_of({true, true}, {warning}).exit, kExitOk);
  EXPECT_EQ(result_of({true, false}, {error}).exit, kExitPartial);
  EXPECT_EQ(result_of({false, false}, {error}).exit, kExitBadInput);
  EXPECT_EQ(result_of({}, {error}).exit, kExitBadInput);
  const CommandResult both = result_of({true}, {warning, error});
  ASSERT_EQ(both.warnings.size(), 1u);
  ASSERT_EQ(both.errors.size(), 1u);
  EXPECT_EQ(both.warnings[0].code, "SES-KEY");
  EXPECT_EQ(both.errors[0].text, "gone");
  EXPECT_EQ(both.errors[0].hint, "copy");
}

dataset::Timeline Timeline() {
  dataset::Timeline timeline;
  timeline.take = "walk", timeline.reference = "left", timeline.fps_hz = 25, timeline.num_time_steps = 5;
  timeline.clock = dataset::TimelineClock::kCommon;
  dataset::CameraTimeline left, right;
  left.name = "left", left.num_frames = 5, left.fps_hz = 25, left.frame_at = {0, 1, 2, 3, 4};
  right.name = "right", right.num_frames = 4, right.fps_hz = 25, right.frame_at = {0, -1, -1, 2, 3};
  right.dropped = {{0, 2}, {3, 5}}, right.doubled = {1}, right.bad_times = {2}, right.offset_frames = -0.25;
  timeline.cameras = {left, right};
  return timeline;
}

TEST(SessionTable, EachCameraOfATimelineHasALine) {
  const std::string text = TimelineText(Timeline());
  EXPECT_THAT(text, HasSubstr("take walk: 5 time steps at 25.0000 Hz, counted by camera left, clocks related by: common"));
  EXPECT_THAT(LineOf(text, "left  "), HasSubstr("+0.000"));
  EXPECT_THAT(LineOf(text, "right  "), HasSubstr("-0.250"));
  EXPECT_THAT(LineOf(text, "right  "), HasSubstr(" 7 ")) << "dropped frames";
}

/// Footage behind one link has one cause, not one a camera.
TEST(SessionTable, OneCauseIsSaidOnce) {
  dataset::SessionReport report;
  for (const char* camera : {"a", "b", "c"})
    report.findings.push_back({"SES-OUTSIDE", std::string("camera ") + camera + ": leaves the session", "option", true});
  report.findings.push_back({"SES-MISSING", "d", "", true});
  const CommandResult result = DescribeFootageFindings(report);
  ASSERT_EQ(result.errors.size(), 2u);
  EXPECT_EQ(result.errors[0].text, "camera a: leaves the session (and 2 others like it)");
  EXPECT_EQ(result.errors[1].code, "SES-MISSING");
}

}  // namespace
}  // namespace mvstudio::stages
