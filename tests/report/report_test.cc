#include "core/error.h"
#include "tests/report/markup.h"
#include "tests/report/run_fixture.h"

namespace mvstudio::report {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(ReportTest, NumbersInJsonAreThoseOfTheInputs) {
  SaveWholeRun();
  const Report report = Build();
  EXPECT_EQ(json_["schema"], "mvstudio.report/1");
  EXPECT_EQ(json_["verdict"], "warn");
  EXPECT_EQ(report.num_stages, 4);
  EXPECT_EQ(StageOf("calibrate")["metrics"]["baseline_mm"].get<double>(), 83.12345678901234);
  EXPECT_EQ(StageOf("calibrate")["metrics"]["cameras"][1]["rms_px"], nullptr);
  EXPECT_EQ(StageOf("avatar eval")["metrics"]["holdout"]["fd"]["value"], 3.5);
  EXPECT_EQ(json_["calibration"]["cameras"][0]["focal_px"], 530.625) << "the mean of fx and fy";
  EXPECT_DOUBLE_EQ(json_["calibration"]["cameras"][0]["focal_sigma_px"].get<double>(), std::sqrt(0.04 / 2));
  EXPECT_DOUBLE_EQ(json_["calibration"]["cameras"][1]["center_in_world_m"][0].get<double>(), 0.083);
  const Json& joints = json_["triangulation"][0]["joints"];
  EXPECT_EQ(joints[0]["joint"], "MidHip");
  EXPECT_DOUBLE_EQ(joints[0]["median_rms_px"].get<double>(), 2.0);
  EXPECT_DOUBLE_EQ(joints[0]["median_sigma_mm"].get<double>(), 4.0);
  EXPECT_EQ(joints[2]["ok"], 0);
  EXPECT_EQ(joints[2]["median_rms_px"], nullptr);
  EXPECT_EQ(json_["triangulation"][0]["status_counts"]["LowParallax"], 4);
  EXPECT_EQ(json_["training"][0]["last"]["total"], 0.2);
  EXPECT_EQ(json_["provenance"][0]["argv"][3], "a=b c");
}

TEST_F(ReportTest, PageShowsTheRun) {
  SaveWholeRun();
  const Report report = Build();
  for (const char* text : {"83.123", "535.12 ± 0.31", "camera left saw the board in few places", "show it &lt;everywhere&gt;",
                           "Look at left first: off by 5", "LowParallax 4", "0.9125", "camera left, frame 84",
                           "&#39;a=b c&#39;", "no mask", "7.5", "data:image/png;base64,iVBOR"}) {
    EXPECT_THAT(report.html, HasSubstr(text));
  }
  ExpectOffline(report.html);
}

TEST_F(ReportTest, ScoresStandUnderTheirHeadings) {
  SaveAvatar();
  const std::string html = Build().html;
  const size_t begin = html.find("Scores beside the baselines"), end = html.find("</table>", begin);
  const std::string table = std::regex_replace(html.substr(begin, end - begin), std::regex("(<[^>]*>| |\n)+"), "|");
  EXPECT_THAT(table, HasSubstr("|images|SSIM|PSNR|dB|mask|IoU|Fréchet|distance|its|floor|features|n|d|"));
  EXPECT_THAT(table, HasSubstr("|this|avatar,|held|out|8|0.9125|24.50|0.9500|3.5|0.5|random|8|64|"));
}

TEST_F(ReportTest, EveryFigureIsWellFormedAndLabelled) {
  SaveWholeRun();
  const Report report = Build();
  const std::vector<std::string> figures = SvgFigures(report.html);
  EXPECT_GE(figures.size(), 12u);
  for (const std::string& figure : figures) {
    EXPECT_EQ(CheckMarkup(figure), "");
    EXPECT_THAT(figure, HasSubstr("aria-label=\""));
    EXPECT_THAT(figure, Not(::testing::ContainsRegex("=\"-?(nan|inf)")));
  }
}

TEST_F(ReportTest, AJointThatIsAlwaysThereHasNoGaps) {
  for (const int frames : {100, 193, 240, 700}) {
    std::string csv = "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n";
    for (int f = 0; f < frames; ++f) csv += std::to_string(f) + ",0,Nose,Ok,1,2,3,2,1,0.001\n";
    for (int f = 0; f < frames; ++f)
      csv += std::to_string(f) + (f == 0 ? ",0,Neck,Outlier,,,,2,," : ",0,Neck,Ok,1,2,3,2,1,0.001") + "\n";
    SaveText("points.csv", csv);
    const Report report = Build();
    const size_t begin = report.html.find("Joints over time"), end = report.html.find("</svg>", begin);
    ASSERT_NE(begin, std::string::npos);
    const std::string figure = report.html.substr(begin, end - begin);
    size_t runs = 0;
    for (size_t at = figure.find("class=\"h4\""); at != std::string::npos; at = figure.find("class=\"h4\"", at + 1)) ++runs;
    EXPECT_EQ(runs, 2u) << frames << " frames: of one that is always there, and of one that is not at first";
  }
}

TEST_F(ReportTest, ValuesOfTheWrongKindDoNotMatter) {
  for (const char* command :
       {"calibrate", "triangulate", "dataset build", "dataset verify", "avatar train", "avatar eval", "demo"}) {
    const Json odd = {{"cameras", "none"},
                      {"residuals", {{"a", 3}, {"b", {1, 2}}, {"c", {{"x"}}}}},
                      {"rms_px", "0.2"},
                      {"holdout", {1, 2}},
                      {"baselines", 7},
                      {"per_camera", {{"name", 3}}},
                      {"status_counts", {{"Ok", nullptr}, {"Bad", -3}}},
                      {"checks", {1, "x", nullptr}},
                      {"truth", {{"joints", {1, "a", nullptr}}}},
                      {"findings", {1, {{"a", 1}}}}};
    Json result = Result(command, odd);
    result["warnings"] = "none";
    result["outputs"] = {3, {{"path", 4}}, {{"role", "heldout-picture"}}};
    Save(std::string(command) + ".result.json", result);
  }
  Save("calibration.json",
       {{"cameras", {1, {{"name", 2}, {"size_px", {"a"}}}, {{"cam_from_world", {{"rotation_xyzw", {0, 0, 0, 0}}}}}}}});
  const Report report = Build();
  EXPECT_EQ(report.num_stages, 7);
  for (const std::string& figure : SvgFigures(report.html)) EXPECT_EQ(CheckMarkup(figure), "");
}

TEST_F(ReportTest, FilesWithoutResultsAreShownAlone) {
  SaveText("points.csv",
           "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n0,0,Nose,Ok,1,2,3,0,0,0\n1,0,Nose,Ok,1,2,3,0,0,0\n"
           "1,0,Neck,Ok,1,2,2,0,0,0\n");
  const Report points = Build();
  EXPECT_THAT(points.html, AllOf(HasSubstr("2 joints over 2 time steps."), HasSubstr("id=\"studio\"")));
  EXPECT_THAT(points.html,
              AllOf(Not(HasSubstr("not run")), Not(HasSubstr("id=\"verdict\"")), Not(HasSubstr("id=\"triangulation\"")),
                    Not(HasSubstr("0 px")), Not(HasSubstr("id=\"provenance\""))));
  SaveText("points.csv", "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n0,0,Nose,Ok,1,2,3,2,1,0.01\n");
  EXPECT_THAT(Build().html, AllOf(HasSubstr("1 joint over 1 time step."), HasSubstr("id=\"triangulation\"")));
}

TEST_F(ReportTest, ASingleResultSaysWhatWasNotRun) {
  SaveCalibrate();
  const Report report = Build();
  EXPECT_EQ(report.verdict, Verdict::kWarn);
  EXPECT_THAT(report.html,
              AllOf(HasSubstr("Triangulation: not run"), HasSubstr("Avatar: not run"), HasSubstr("Dataset: not run")));
}

TEST_F(ReportTest, NothingToReport) {
  EXPECT_THROW(BuildReport(run_ + "/missing"), IoError);
  EXPECT_THROW(BuildReport(run_), IoError);
  SaveText("notes.txt", "x");
  SaveText("only.result.json", "{");
  try {
    BuildReport(run_);
    FAIL();
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("nothing to report"), HasSubstr("only.result.json"), HasSubstr("expected *.result.json")));
  }
}

TEST_F(ReportTest, WritesBothFilesAndTheSameBytesAgain) {
  SaveWholeRun();
  const Report report = BuildReport(run_);
  EXPECT_EQ(WriteReport(report, run_ + "/report.html"), run_ + "/report.json");
  EXPECT_EQ(ReadFile(run_ + "/report.html"), report.html);
  EXPECT_EQ(ReadFile(run_ + "/report.json"), report.json);
  EXPECT_EQ(BuildReport(run_).html, report.html);
  EXPECT_THROW(WriteReport(report, run_ + "/x.json"), UsageError);
}

}  // namespace
}  // namespace mvstudio::report
