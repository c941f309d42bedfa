#include "core/error.h"
#include "tests/report/markup.h"
#include "tests/report/run_fixture.h"

namespace mvstudio::report {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(ReportTest, AMovedRunStillShowsItsImagesAndAMissingOneIsNamed) {
  SaveWholeRun();
  const Report report = Build();
  EXPECT_THAT(report.warnings,
              Contains(AllOf(Field(&Notice::code, "REP-PICTURE"), Field(&Notice::text, HasSubstr("gone.png")))));
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_THAT(report.html, HasSubstr("gone.png"));
}

/// A run of somebody else's that names, or links to, what lies elsewhere: the same is said whether or not something is there.
TEST_F(ReportTest, NothingFromOutsideTheRunIsEmbeddedAndNobodyLearnsWhetherItIsThere) {
  const std::string outside = run_ + "-outside", lure = "PRIVATE";
  MakeFolder(outside);
  const auto remove = std::unique_ptr<const std::string, void (*)(const std::string*)>(
      &outside, [](const std::string* folder) { fs::remove_all(*folder); });
  const std::string name = fs::path(outside).filename().string();
  fs::create_directory_symlink("../" + name, run_ + "/pictures");
  fs::create_symlink(outside + "/there.png", run_ + "/link_there.png");
  fs::create_symlink(outside + "/gone.png", run_ + "/link_gone.png");
  fs::create_symlink(run_ + "/sub/own.png", run_ + "/inside.png");
  fs::create_symlink("../sub/own.png", run_ + "/out_and_in.png");  // from the run's parent: outside
  for (const char* file : {"x.result.json", "points.csv", "provenance.jsonl"})
    fs::create_symlink(outside + "/" + file, run_ + "/" + file);
  SavePng("sub/own.png");
  WriteFileAtomic(outside + "/there.png", ReadFile(run_ + "/sub/own.png") + lure);
  WriteFileAtomic(outside + "/x.result.json", Result("metrics", {{"note", lure}}).dump());
  WriteFileAtomic(outside + "/provenance.jsonl", "{\"command\": \"" + lure + "\"}\n");
  WriteFileAtomic(outside + "/points.csv", "frame,person,joint,status," + lure + "\n0,0,a,Ok,1\n");
  const auto build = [&](const std::string& path, bool follow = false) {
    Json result = Result("avatar eval", {{"holdout", {{"n", 8}, {"ssim", 0.9}}}});
    result["outputs"] = {{{"path", path}, {"role", "textures"}}};
    Save("avatar_eval.result.json", result);
    ReportOptions options;
    options.follow_links = follow;
    const Report report = Build(options);
    std::string said;
    for (const Notice& warning : report.warnings) said += warning.code + ": " + warning.text + "\n";
    return std::pair(report.html, said);
  };
  const size_t whole = build("sub/own.png").first.size();
  for (const std::string& there : {outside + "/there.png", "../" + name + "/there.png", "sub/../../" + name + "/there.png",
                                   std::string("pictures/there.png"), std::string("link_there.png")}) {
    std::string gone = there;
    gone.replace(gone.rfind("there"), 5, "gone");
    const auto [html, said] = build(there);
    const auto [other, other_said] = build(gone);
    EXPECT_THAT(html, Not(HasSubstr("data:image"))) << there;
    EXPECT_THAT(said, HasSubstr("REP-OUTSIDE: avatar_eval.result.json: image " + there)) << there;
    EXPECT_THAT(html, HasSubstr("REP-OUTSIDE")) << "the page says so";
    EXPECT_EQ(std::regex_replace(said, std::regex("there"), "gone"), other_said);
    EXPECT_EQ(std::regex_replace(html, std::regex("there"), "gone"), std::regex_replace(other, std::regex("there"), "gone"));
    EXPECT_THAT(html, Not(HasSubstr(lure))) << "nor results through links";
    EXPECT_THAT(build(there, true).first, HasSubstr("data:image")) << "for a run that one trusts";
  }
  EXPECT_THAT(build("out_and_in.png").second, HasSubstr("REP-OUTSIDE: avatar_eval"));
  EXPECT_THAT(build("inside.png").first, HasSubstr("data:image")) << "a link inside the run";
  EXPECT_THAT(build(run_ + "/sub/own.png").first, HasSubstr("data:image"));
  EXPECT_THAT(build("/elsewhere/sub/own.png").first, HasSubstr("data:image")) << "a run that was moved";
  EXPECT_GT(whole, 0u);
}

TEST_F(ReportTest, HostileNamesAreEscapedEverywhere) {
  SaveCalibration("calibration.json", kHostile);
  SaveCalibrate(kHostile);
  SaveText("points.csv",
           std::string(
               "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n0,0,<script>j,</svg><script>,1,2,3,2,1,1\n") +
               "0,0,<script>j,Ok,1,2,3,2,1,1\n1,0,<script>j,Ok,1,2,3,2,1,1\n");
  SaveText("history.csv", "step,phase,<script>\n1,<script>,3\n2,<script>,4\n");
  Json result = Result(
      kHostile,
      {{kHostile, 1}, {"nested", {{kHostile, kHostile}}}, {"checks", {{{"name", kHostile}, {"value", 1}, {"pass", false}}}}});
  result["argv"] = {kHostile};
  result["errors"] = {{{"code", kHostile}, {"text", kHostile}, {"hint", kHostile}}};
  Save("x/x.result.json", result);
  result["command"] = "avatar eval";
  result["metrics"]["holdout"] = {{"ssim", 0.5}, {"kind", kHostile}, {"fd", {{"features", kHostile}}}};
  result["metrics"]["per_camera"] = {{{"name", kHostile}, {"ssim", 0.5}, {kHostile, 1}}};
  result["outputs"] = {{{"path", std::string(kHostile) + ".png"}, {"role", "heldout-picture"}}};
  Save("y/y.result.json", result);
  ReportOptions options;
  options.title = kHostile;
  options.generated_at = kHostile;
  options.version = kHostile;
  const Report report = Build(options);
  const std::string plain = WithoutViewer(report.html);
  EXPECT_THAT(plain, Not(HasSubstr("<script")));
  EXPECT_THAT(plain, Not(HasSubstr("alert(\"")));
  for (const std::string& figure : SvgFigures(report.html)) EXPECT_EQ(CheckMarkup(figure), "");
}

TEST_F(ReportTest, BrokenFilesBecomeWarningsThatNameThem) {
  SaveCalibrate();
  SaveText("a/broken.result.json", "{\"schema\": \"mvstudio.result/1\", \"met");
  SaveText("b/deep.result.json", std::string(200000, '['));
  SaveText("c/list.result.json", "[1, 2]");
  SaveText("d/foreign.result.json", "{\"schema\": \"other/1\"}");
  SaveText("calibration.json", "{\"cameras\": 3}");
  SaveText("pose3d/points.csv", "frame,joint\n1\n2,Nose\n");
  SaveText("avatar/history.csv", "");
  SaveText("provenance.jsonl", "{\"time\":\"1\",\"argv\":[\"x\"]}\nnot json\n");
  const Report report = Build();
  EXPECT_EQ(report.num_stages, 1);
  for (const char* name : {"a/broken.result.json", "b/deep.result.json", "c/list.result.json", "d/foreign.result.json",
                           "calibration.json", "pose3d/points.csv: line 2", "avatar/history.csv", "provenance.jsonl: line 2"}) {
    EXPECT_THAT(report.warnings, Contains(Field(&Notice::text, HasSubstr(name))));
    EXPECT_THAT(report.html, HasSubstr(name));
  }
  EXPECT_EQ(report.warnings.size(), 8u);
  EXPECT_EQ(json_["warnings"].size(), 8u);
}

TEST_F(ReportTest, TheRunsOwnReportAndTheTruthAreNotStages) {
  SaveCalibrate();
  Save("report.result.json", Result("report", Json::object()));
  SaveCalibration("session/truth/calibration.json", "true");
  SaveCalibration("calibration.json", "own");
  SaveCalibration("a/b/c/d/e/calibration.json", "too deep");
  const Report report = Build();
  EXPECT_EQ(report.num_stages, 1);
  EXPECT_EQ(json_["calibration"]["cameras"][0]["name"], "own");
  EXPECT_THAT(report.html, Not(HasSubstr("too deep")));
  EXPECT_THAT(report.html, Not(HasSubstr("Other calibration files")));
}

TEST_F(ReportTest, ImagesBeyondTheLimitAreNamed) {
  SaveAvatar();
  ReportOptions options;
  options.max_images_total_mb = 0;
  const Report report = Build(options);
  EXPECT_THAT(report.html, Not(HasSubstr("data:image/png")));
  EXPECT_THAT(report.warnings, Contains(Field(&Notice::text, HasSubstr("left_00000084.png"))));
}

}  // namespace
}  // namespace mvstudio::report
