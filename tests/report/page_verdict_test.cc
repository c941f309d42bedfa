#include "tests/report/run_fixture.h"

namespace mvstudio::report {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(ReportTest, AStageThatRunSawFailIsNoStageThatWasNotRun) {
  Save("calib/calibrate.result.json", Result("calibrate", Json::object()));
  const Json error = {{"code", "INPUT-FORMAT"}, {"text", "camera gopro4: no calibration <b>"}, {"hint", "calibrate it"}};
  const auto stage = [&](const std::vector<std::string>& words, int exit, const Json& errors) {
    return Json{{"stage", words[0]}, {"words", words}, {"exit", exit}, {"errors", errors}};
  };
  Save("run.json", {{"schema", "mvstudio.run/1"},
                    {"stages",
                     {stage({"calibrate", "--session", "."}, 0, Json::array()),
                      stage({"triangulate", "--session", "."}, 3, Json::array({error})),
                      stage({"dataset", "build", "--session", "."}, 3, Json::array({error}))}}});
  const Report report = Build();
  EXPECT_EQ(report.verdict, Verdict::kFail);
  EXPECT_EQ(report.num_stages, 3);
  EXPECT_EQ(json_["stages"][1]["command"], "triangulate");
  EXPECT_EQ(json_["stages"][2]["command"], "dataset build");
  EXPECT_THAT(report.html, HasSubstr("camera gopro4: no calibration &lt;b&gt;"));
  Save("triangulate.result.json", [&] {
    Json own = Result("triangulate", Json::object());
    own["status"] = "error", own["exit"] = 4, own["errors"] = Json::array({error});
    return own;
  }());
  EXPECT_EQ(Build().num_stages, 3) << "its own result tells it";
}

/// What stands between the cards and the first section, without tags.
std::string FixListOf(const std::string& html) {
  const size_t begin = html.find("What to fix first"), end = html.find("</section>", begin);
  return std::regex_replace(html.substr(begin, end - begin), std::regex("(<[^>]*>|\\s)+"), " ");
}

TEST_F(ReportTest, TheWorstCameraAndTheWorstFrameAreOneClickAway) {
  SaveCalibration("calibration.json", "left cam&");
  SaveCalibrate("left cam&");
  SaveTriangulation();
  const std::string html = Build().html;
  EXPECT_THAT(html, HasSubstr("worst camera <a href=\"#camera=left%20cam%26\">left cam&amp;</a>, rms 0.212"));
  EXPECT_THAT(html, HasSubstr("<a href=\"#frame=3\">frame 3</a> (2.63\u00a0px; worst MidHip, 3.5\u00a0px by 2 cameras)"))
      << "sqrt((3.5^2 + 1.25^2) / 2) = 2.63";
  EXPECT_THAT(html, HasSubstr("Most joints without a position: <a href=\"#frame=0\">frame 0</a> (1 low parallax), <a"));
  EXPECT_THAT(html.substr(0, html.find("<nav")),
              AllOf(HasSubstr("largest residuals at <a href=\"#frame=3\">"), HasSubstr("(1 low parallax).</li>")));
  ReportOptions client;
  client.audience = "client";
  EXPECT_THAT(Build(client).html, Not(HasSubstr("orst camera")));
}

TEST_F(ReportTest, OnlyWhatWasRunHasACard) {
  SaveCalibrate();
  const std::string html = Build().html;
  const size_t begin = html.find("<div class=\"cards\">"), end = html.find("What to fix first");
  const std::string cards = html.substr(begin, end - begin);
  EXPECT_THAT(cards, AllOf(HasSubstr("calibrate"), HasSubstr("card warn"), Not(HasSubstr("not run"))));
}

/// A lost camera makes later stages complain of it, too: the stage that lost it comes first, and says it once.
TEST_F(ReportTest, WhatToFixTellsFailuresAndCausesFirstAndEachKindOnce) {
  const auto notice = [](const char* code, const char* text) {
    return Json{{"code", code}, {"text", text}, {"hint", std::string("mend ") + code}};
  };
  Json calibrate = Result(
      "calibrate",
      {{"cameras",
        {{{"name", "left"}, {"rms_px", 0.2}}, {{"name", "cam_2"}, {"rms_px", 0.9}}, {{"name", "right"}, {"rms_px", 0.25}}}},
       {"board_views",
        {{{"camera", "left"}, {"frame", 3}, {"rms_px", 0.3}}, {{"camera", "cam_2"}, {"frame", 17}, {"rms_px", 1.5}}}}});
  calibrate["status"] = "warn";
  calibrate["warnings"] = {notice("CAL-SOFT", "camera left: soft"), notice("CAL-LEFTOUT", "camera lost: no board"),
                           notice("CAL-SOFT", "camera right: soft, too")};
  Json triangulate = Result("triangulate", {{"num_points", 0}});
  triangulate["status"] = "fail", triangulate["exit"] = 5;
  triangulate["errors"] = {notice("TRI-FEW", "too few views")};
  triangulate["warnings"] = {notice("CAL-LEFTOUT", "no calibration of lost")};
  Save("pose3d/triangulate.result.json", triangulate);
  Save("calibrate.result.json", calibrate);
  const std::string html = Build().html, list = FixListOf(html);
  const auto at = [&](const std::string& text) {
    EXPECT_THAT(list, HasSubstr(text));
    return list.find(text);
  };
  EXPECT_LT(at("too few views"), at("camera left: soft")) << "a failure before a warning";
  EXPECT_LT(at("camera lost: no board"), at("no calibration of lost")) << "the cause first";
  at("calibrate \u00b7 CAL-SOFT \u00b7 cameras left, right");
  at("calibrate, triangulate \u00b7 CAL-LEFTOUT \u00b7 camera lost");
  EXPECT_EQ(list.find("\u00b7 CAL-SOFT"), list.rfind("\u00b7 CAL-SOFT")) << "one line a code";
  EXPECT_EQ(list.find("mend CAL-LEFTOUT"), list.rfind("mend CAL-LEFTOUT"));
  EXPECT_THAT(html.substr(0, html.find("<nav")),
              HasSubstr("worst camera cam_2, rms 0.9\u00a0px (median 0.25\u00a0px); worst frame 17 of cam_2, rms 1.5\u00a0px"))
      << "seen without scrolling";
  EXPECT_THAT(list, Not(HasSubstr("No frame failed")));
  const std::string cards = html.substr(0, html.find("What to fix first"));
  EXPECT_THAT(cards, HasSubstr("<p>too few views</p>")) << "a failed stage shows its error";
  EXPECT_EQ(json_["sentence"], "1 of 2 results failed. First, triangulate: too few views");
  EXPECT_THAT(html, HasSubstr("<p class=\"sentence\">1 of 2 results failed. First, triangulate: too few views</p>"));
}

TEST_F(ReportTest, ARunWithoutWarningsSaysSo) {
  Save("a/dataset_verify.result.json", Result("dataset verify", {{"frames", 4}}));
  Save("b/metrics.result.json", Result("metrics", {{"ssim", 0.5}}));
  EXPECT_THAT(FixListOf(Build().html), HasSubstr("No frame failed, no warnings."));
  EXPECT_EQ(json_["sentence"], "All 2 results passed.");
}

TEST_F(ReportTest, CardsHaveRoundedNumbersWithUnits) {
  Save("session/synth.result.json", Result("synth", {{"px_per_s", 10412345.678}}));
  Save("masks/mask.result.json", Result("mask", {{"pictures", 36}, {"flicker", 2.35e-6}}));
  Save("avatar/avatar_train.result.json", Result("avatar train", {{"num_parameters", 3908288}, {"it_per_s", 2.904911}}));
  Save("texture/avatar_texture.result.json", Result("avatar texture", {{"it_per_s", 2.904911}}));
  Save("calibrate.result.json", Result("calibrate", {{"rms_px", 0.123456}, {"baseline_mm", 4312.3456}}));
  const std::string html = Build().html, cards = html.substr(0, html.find("What to fix first"));
  for (const char* pair :
       {"<dt>px per second</dt><dd>10.4\u00a0million</dd>", "<dt>pixels that flicker</dt><dd>below 0.001%</dd>",
        "<dt>steps per second</dt><dd>2.9</dd>", "<dt>parameters</dt><dd>3\u202f908\u202f288</dd>",
        "<dt>rms</dt><dd>0.123\u00a0px</dd>", "<dt>baseline</dt><dd>4\u202f312\u00a0mm</dd>"}) {
    EXPECT_THAT(cards, HasSubstr(pair));
  }
}

TEST_F(ReportTest, AMissedCheckIsAsBadAsTheCommandSays) {
  Json check = {{"name", "joints"}, {"value", 4.75}, {"bound", 4.5}, {"unit", "mm"}, {"at_least", false}, {"pass", false}};
  Json result = Result("demo", {{"truth", {{"joints_median_mm", 4.75}}}, {"checks", {check}}});
  Save("demo.result.json", result);
  EXPECT_EQ(Build().verdict, Verdict::kWarn);
  result["status"] = "fail";
  Save("demo.result.json", result);
  const Report report = Build();
  EXPECT_EQ(report.verdict, Verdict::kFail);
  EXPECT_THAT(report.html,
              AllOf(HasSubstr("0 of 1"), HasSubstr("≤ 4.5"), HasSubstr("joints: 4.75\u00a0mm, bound 4.5\u00a0mm")));
}

}  // namespace
}  // namespace mvstudio::report
