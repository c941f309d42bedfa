#include "report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/viewer/bundle.h"
#include "tests/report/markup.h"

namespace mvstudio::report {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr char kHostile[] = "<script>alert(\"x\")</script>&'";

Json Result(const std::string& command, const Json& metrics) {
  return {{"schema", "mvstudio.result/1"},
          {"command", command},
          {"version", "0.1.0"},
          {"status", "ok"},
          {"exit", 0},
          {"metrics", metrics},
          {"outputs", Json::array()},
          {"warnings", Json::array()},
          {"errors", Json::array()},
          {"timing", {{"wall_s", 1.5}, {"peak_rss_mb", 10.0}}},
          {"argv", {"mvstudio", command}}};
}

/// A run folder of its own for each test, removed afterwards.
class ReportTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    run_ = (fs::temp_directory_path() / ("mvstudio-report-" + std::to_string(getpid()) + "-" + info->name())).string();
    fs::remove_all(run_);
    MakeFolder(run_);
  }
  void TearDown() override { fs::remove_all(run_); }

  void Save(const std::string& file, const Json& json) { WriteFileAtomic(run_ + "/" + file, json.dump(1)); }
  void SaveText(const std::string& file, const std::string& text) { WriteFileAtomic(run_ + "/" + file, text); }

  Report Build(const ReportOptions& options = {}) {
    Report report = BuildReport(run_, options);
    json_ = Json::parse(report.json);
    return report;
  }
  const Json& StageOf(const std::string& command) {
    for (const Json& stage : json_["stages"]) {
      if (stage["command"] == command) return stage;
    }
    ADD_FAILURE() << "no stage " << command;
    return json_;
  }

  void SaveCalibration(const std::string& file, const std::string& name = "left") {
    Json cameras = Json::array();
    for (int i = 0; i < 2; ++i) {
      Json covariance = Json::array();
      for (int r = 0; r < 4; ++r) covariance.push_back({r == 0 ? 0.04 : 0, 0, 0, 0});
      cameras.push_back({{"name", i == 0 ? name : "right"},
                         {"model", "pinhole"},
                         {"size_px", {640, 480}},
                         {"intrinsics", {{"fx", 530.25}, {"fy", 531}, {"cx", 320}, {"cy", 240}}},
                         {"cam_from_world", {{"rotation_xyzw", {0, 0, 0, 1}}, {"translation", {-0.083 * i, 0, 0}}}},
                         {"intrinsics_covariance", covariance}});
    }
    Save(file, {{"schema", "mvstudio.calibration/1"}, {"unit", "m"}, {"gauge", "left"}, {"cameras", cameras}});
  }
  void SaveCalibrate(const std::string& name = "left") {
    const Json camera = {{"name", name},           {"model", "brown5"}, {"num_params", 9},          {"focal_px", 535.125},
                         {"focal_sigma_px", 0.31}, {"rms_px", 0.2125},  {"holdout_rms_px", 0.2375}, {"coverage", 0.75},
                         {"num_rejected", 3}};
    Json other = camera;
    other["name"] = "right", other["rms_px"] = nullptr, other["holdout_rms_px"] = nullptr;
    Json result = Result(
        "calibrate",
        {{"rms_px", 0.2525},
         {"holdout_rms_px", 0.2625},
         {"baseline_mm", 83.12345678901234},
         {"cameras", {camera, other}},
         {"residuals", {{name, {{100, 50, 0.1, -0.2}, {500, 400, -0.1, 0.1}, {1, 2, nullptr, 3}}}, {"right", Json::array()}}}});
    result["status"] = "warn";
    result["warnings"] = {{{"code", "CAL-LOWCOV"},
                           {"text", "camera " + name + " saw the board in few places"},
                           {"hint", "show it <everywhere>"}}};
    Save("calibrate.result.json", result);
  }
  void SaveTriangulation() {
    std::string csv = "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n";
    for (int frame = 0; frame < 4; ++frame) {
      csv += std::to_string(frame) + ",0,MidHip,Ok,0.1,0.2," + std::to_string(1 + 0.1 * frame) + ",2," +
             std::to_string(0.5 + frame) + ",0.004\n";
      csv += std::to_string(frame) + ",0,Neck,Ok,0.1,0.2,1.5,2,1.25,0.002\n";
      csv += std::to_string(frame) + ",0,Nose,LowParallax,,,,2,,\n";
    }
    SaveText("pose3d/points.csv", csv);
    Save("pose3d/triangulate.result.json", Result("triangulate", {{"num_points", 12},
                                                                  {"status_counts", {{"Ok", 8}, {"LowParallax", 4}}},
                                                                  {"mean_rms_px", 1.5},
                                                                  {"median_rms_px", 1.25},
                                                                  {"cameras",
                                                                   {{{"name", "left"}, {"mean_residual_px", {4.0, -3.0}}},
                                                                    {{"name", "right"}, {"mean_residual_px", {0.1, 0.0}}}}},
                                                                  {"points_per_s", 1234.5},
                                                                  {"trc", {{"median_mm", 7.5}}}}));
  }
  /// A whole PNG of one pixel.
  void SavePng(const std::string& path) {
    const unsigned char png[] = {0x89, 'P',  'N',  'G',  13,  10,  26,  10,   0,    0,    0,    13,  'I',  'H',  'D',  'R',  0,
                                 0,    0,    1,    0,    0,   0,   1,   8,    0,    0,    0,    0,   0x3a, 0x7e, 0x9b, 0x55, 0,
                                 0,    0,    10,   'I',  'D', 'A', 'T', 0x78, 0x9c, 0x63, 0x60, 0,   0,    0,    2,    0,    1,
                                 0x48, 0xaf, 0xa4, 0x71, 0,   0,   0,   0,    'I',  'E',  'N',  'D', 0xae, 0x42, 0x60, 0x82};
    SaveText(path, std::string(reinterpret_cast<const char*>(png), sizeof(png)));
  }
  void SaveAvatar() {
    SaveText("avatar/history.csv",
             "step,phase,total,ssim,wall_s\n1,init,2.0,0,1\n2,init,nan,0,2\n3,train,0.1,0.5,3\n4,validation,0.2,0.6,4\n");
    SavePng("avatar/eval/left_00000084.png");
    const Json fd = {{"value", 3.5}, {"features", "random"}, {"n", 8}, {"d", 64}, {"floor", 0.5}};
    Json result = Result(
        "avatar eval", {{"holdout", {{"n", 8}, {"ssim", 0.9125}, {"psnr_db", 24.5}, {"mask_iou", 0.95}, {"fd", fd}}},
                        {"baselines", {{"mean_image", {{"ssim", 0.8}, {"psnr_db", 20.5}, {"mask_iou", 0.7}, {"fd", nullptr}}}}},
                        {"per_camera", {{{"name", "left"}, {"ssim", 0.9125}, {"psnr_db", 24.5}, {"mask_iou", nullptr}}}}});
    result["outputs"] = {{{"path", "/somewhere/else/avatar/eval/left_00000084.png"}, {"role", "heldout-picture"}},
                         {{"path", "gone.png"}, {"role", "textures"}}};
    Save("avatar/avatar_eval.result.json", result);
  }
  void SaveWholeRun() {
    SaveCalibration("calibration.json");
    SaveCalibrate();
    SaveTriangulation();
    SaveAvatar();
    Save("dataset/dataset_verify.result.json",
         Result("dataset verify", {{"frames", 4}, {"findings", {{{"camera", "left"}, {"frame", 2}, {"text", "no mask"}}}}}));
    SaveText(
        "provenance.jsonl",
        R"({"time":"2026-01-02T03:04:05Z","command":"calibrate","version":"0.1.0","argv":["mvstudio","calibrate","--camera","a=b c"],"exit":0,"wall_s":2})"
        "\n");
  }

  std::string run_;
  Json json_;
};

/// Each <svg> of a page, nested ones inside their outermost.
std::vector<std::string> Figures(const std::string& html) {
  std::vector<std::string> figures;
  for (size_t at = html.find("<svg"); at != std::string::npos; at = html.find("<svg", at)) {
    const size_t begin = at;
    int depth = 0;
    do {
      const size_t open = html.find("<svg", at), close = html.find("</svg>", at);
      if (close == std::string::npos) return figures;
      const bool opens = open < close;
      depth += opens ? 1 : -1;
      at = opens ? open + 4 : close + 6;
    } while (depth > 0);
    figures.push_back(html.substr(begin, at - begin));
  }
  return figures;
}

/// The page without the script of its viewer, which is not of the run.
std::string WithoutViewer(std::string html) {
  const std::string viewer = "<script>" + std::string(ViewerScript()) + "</script>";
  const size_t at = html.find(viewer);
  return at == std::string::npos ? html : html.erase(at, viewer.size());
}

void ExpectOffline(const std::string& html) {
  const std::string plain = std::regex_replace(WithoutViewer(html), std::regex(" xmlns=\"http://www.w3.org/2000/svg\""), "");
  for (const char* outside :
       {"http://", "https://", "src=\"//", "@import", "url(", "<script", "<link", "<iframe", "javascript:"}) {
    EXPECT_THAT(plain, Not(HasSubstr(outside)));
  }
}

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
  const std::vector<std::string> figures = Figures(report.html);
  EXPECT_GE(figures.size(), 12u);
  for (const std::string& figure : figures) {
    EXPECT_EQ(CheckMarkup(figure), "");
    EXPECT_THAT(figure, HasSubstr("aria-label=\""));
    EXPECT_THAT(figure, Not(::testing::ContainsRegex("=\"-?(nan|inf)")));
  }
}

TEST_F(ReportTest, AMovedRunStillShowsItsPicturesAndAMissingOneIsNamed) {
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
  for (const std::string& figure : Figures(report.html)) EXPECT_EQ(CheckMarkup(figure), "");
}

TEST_F(ReportTest, AJointThatIsAlwaysThereHasNoGaps) {
  for (const int frames : {100, 193, 240, 700}) {
    std::string csv = "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n";
    for (int f = 0; f < frames; ++f) csv += std::to_string(f) + ",0,Nose,Ok,1,2,3,2,1,0.001\n";
    SaveText("points.csv", csv);
    const Report report = Build();
    const size_t begin = report.html.find("Joints over time"), end = report.html.find("</svg>", begin);
    ASSERT_NE(begin, std::string::npos);
    const std::string figure = report.html.substr(begin, end - begin);
    size_t runs = 0;
    for (size_t at = figure.find("class=\"h4\""); at != std::string::npos; at = figure.find("class=\"h4\"", at + 1)) ++runs;
    EXPECT_EQ(runs, 1u) << frames << " frames";
  }
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
  for (const std::string& figure : Figures(report.html)) EXPECT_EQ(CheckMarkup(figure), "");
}

TEST_F(ReportTest, KeyPointsAndMasksShowTheirPictures) {
  for (const char* command : {"pose2d", "mask"}) {
    SavePng(std::string(command) + "/left.png");
    Json result = Result(command, {{"backend", "background"}, {"per_camera", {{{"name", "left"}, {"flicker", 0.0125}}}}});
    result["outputs"] = {{{"path", std::string("/moved/") + command + "/left.png"}, {"role", "overlay"}}};
    Save(std::string(command) + "/" + command + ".result.json", result);
  }
  const Report report = Build();
  EXPECT_THAT(report.html, AllOf(HasSubstr("Footage, keypoints and masks"), HasSubstr("0.0125"), HasSubstr("background")));
  size_t pictures = 0;
  for (size_t at = report.html.find("data:image/png"); at != std::string::npos; at = report.html.find("data:image/png", at + 1))
    ++pictures;
  EXPECT_EQ(pictures, 2u);
  EXPECT_THAT(report.warnings, IsEmpty());
}

TEST_F(ReportTest, AClientSeesThePreviewFirstAndNeitherPathsNorAdvice) {
  SaveWholeRun();
  SaveText("avatar/turn_cam.mp4", std::string("\0\0\0\x18"
                                              "ftypmp42-the-video",
                                              22));
  Json render = Result("avatar render", {{"images", 48}, {"masks_from", "/home/me/masks"}});
  render["outputs"] = {{{"path", "/home/me/run/avatar/turn_cam.mp4"}, {"role", "video"}}};
  render["argv"] = {"mvstudio", "avatar", "render", "/home/me/run"};
  render["errors"] = {{{"code", "X"}, {"text", "/home/me is full"}}};
  Save("avatar/render.result.json", render);
  ReportOptions options;
  options.audience = "client";
  const Report report = Build(options);
  const size_t video = report.html.find("<video controls loop muted src=\"data:video/mp4;base64,AAAAGGZ0eXB");
  ASSERT_NE(video, std::string::npos);
  EXPECT_LT(video, report.html.find("<h2>Verdict"));
  EXPECT_THAT(report.html,
              AllOf(HasSubstr("media-src data:"), HasSubstr("The avatar in motion: turn cam"), HasSubstr("<h2>Rig")));
  for (const std::string& hidden : {run_, std::string("/home/me"), std::string(".json"), std::string("What to fix"),
                                    std::string("Provenance"), std::string("saw the board in few places")}) {
    EXPECT_THAT(report.html.substr(0, report.html.find("<footer>")), Not(HasSubstr(hidden)));
  }
  for (const std::string& hidden : {run_, std::string("/home/me"), std::string("argv"), std::string("outputs")})
    EXPECT_THAT(report.json, Not(HasSubstr(hidden)));
  EXPECT_THAT(Build().html, HasSubstr("<video")) << "the studio's page has it, too";
  options.audience = "friend";
  EXPECT_THROW(BuildReport(run_, options), UsageError);
}

TEST_F(ReportTest, ATurnWithoutAVideoIsShownByEightOfItsImages) {
  Json render = Result("avatar render", {{"images", 20}});
  for (int i = 0; i < 20; ++i) {
    const std::string name = "turn/turn_000000" + std::to_string(10 + i) + ".png";
    SavePng("render/" + name);
    render["outputs"].push_back({{"path", "/gone/render/" + name}, {"role", "rendered-picture"}});
  }
  Save("render/avatar_render.result.json", render);
  const std::string html = Build().html;
  size_t images = 0;
  for (size_t at = html.find("<img "); at != std::string::npos; at = html.find("<img ", at + 1)) ++images;
  EXPECT_EQ(images, 8u);
  EXPECT_THAT(html, AllOf(HasSubstr(">turn 00000010<"), HasSubstr(">turn 00000027<"), Not(HasSubstr("turn 00000011"))));
}

TEST_F(ReportTest, CaptionsAreWordsAndNotPaths) {
  SavePng("masks/cam_01.sheet.png");
  SavePng("masks/other_view.png");
  Json result = Result("mask", {{"per_camera", {{{"name", "cam_01"}, {"flicker", 0.0125}}}}});
  result["outputs"] = {{{"path", "S3/masks/cam_01.sheet.png"}, {"role", "overlay"}},
                       {{"path", "S3/masks/other_view.png"}, {"role", "overlay"}}};
  Save("masks/mask.result.json", result);
  const std::string html = Build().html;
  EXPECT_THAT(html, AllOf(HasSubstr("<figcaption>Outlines of the masks, camera cam_01</figcaption>"),
                          HasSubstr("<figcaption>Outlines of the masks: other view</figcaption>")));
  EXPECT_THAT(html.substr(0, html.find("<section id=\"provenance\"")), Not(HasSubstr("S3/masks"))) << "nor to screen readers";
}

/// Three strips, named so that the worst is neither first nor last, of 4 x 1 and one of 1 x 1 px.
TEST_F(ReportTest, HeldOutImagesComeFirstTheWorstBeforeOthersWithASlider) {
  const double ssim[] = {0.9, 0.7, 0.8};
  Json pictures = Json::array(), outputs = Json::array();
  for (int i = 0; i < 3; ++i) {
    const std::string file = "left_0000000" + std::to_string(i) + ".png";
    SavePng(file);
    if (i > 0) {
      std::string png = ReadFile(run_ + "/" + file);
      png[19] = 4;  // the width that its header states
      SaveText(file, png);
    }
    pictures.push_back({{"path", file}, {"camera", "left"}, {"frame", i}, {"ssim", ssim[i]}});
    outputs.push_back({{"path", file}, {"role", "heldout-picture"}});
  }
  Json result = Result("avatar eval", {{"holdout", {{"n", 3}, {"ssim", 0.8}}}, {"pictures", pictures}});
  result["outputs"] = outputs;
  Save("avatar_eval.result.json", result);
  const std::string html = Build().html;
  const size_t worst = html.find("camera left, frame 1, SSIM 0.700"), next = html.find("camera left, frame 2, SSIM 0.800"),
               best = html.find("camera left, frame 0, SSIM 0.900");
  ASSERT_NE(best, std::string::npos);
  EXPECT_LT(worst, next);
  EXPECT_LT(next, best);
  EXPECT_LT(best, html.find("What to fix first"));
  size_t sliders = 0;
  for (size_t at = html.find(" data-compared>"); at < html.find("<script>"); at = html.find(" data-compared>", at + 1))
    ++sliders;
  EXPECT_EQ(sliders, 2u) << "a square is no strip";
  EXPECT_THAT(html, HasSubstr("script-src 'sha256-"));
  EXPECT_THAT(html, HasSubstr("worst frame 1 of left, SSIM 0.7"));
}

TEST_F(ReportTest, AFittedBodyShowsItsStepsCamerasAndSurface) {
  SavePng("body/surface.png");
  const Json stages = {{{"name", "offsets, smooth to 1.0 mm"}, {"held_out_iou", 0.9375}, {"seconds", 4.5}, {"kept", true}}};
  Json result = Result("avatar fit", {{"stages", stages},
                                      {"cameras", {{"00_07", {{"silhouettes", 12}, {"rejected", 3}, {"iou", 0.9125}}}}},
                                      {"surface_sigma_mm", {{"median", 2.25}, {"quantile_95", 9.5}, {"share_below_10", 0.96}}},
                                      {"surface_maps", {{"offset_limit_mm", 25}, {"sigma_limit_mm", 10}}}});
  result["outputs"] = {{{"path", "surface.png"}, {"role", "surface-maps"}}};
  Save("body/avatar_fit.result.json", result);
  const Report report = Build();
  EXPECT_THAT(report.html, AllOf(HasSubstr("offsets, smooth to 1.0 mm"), HasSubstr("0.9375"), HasSubstr("00_07"),
                                 HasSubstr("0.9125"), HasSubstr("96\u00a0% of the vertices"), HasSubstr("front, deviation")));
  EXPECT_THAT(report.html, HasSubstr("data:image/png"));
  EXPECT_THAT(report.warnings, IsEmpty());
}

TEST_F(ReportTest, ASingleResultSaysWhatWasNotRun) {
  SaveCalibrate();
  const Report report = Build();
  EXPECT_EQ(report.verdict, Verdict::kWarn);
  EXPECT_THAT(report.html,
              AllOf(HasSubstr("Triangulation: not run"), HasSubstr("Avatar: not run"), HasSubstr("Dataset: not run")));
}

/// What stands between the cards and the first section, without tags.
std::string FixListOf(const std::string& html) {
  const size_t begin = html.find("What to fix first"), end = html.find("</section>", begin);
  return std::regex_replace(html.substr(begin, end - begin), std::regex("(<[^>]*>|\\s)+"), " ");
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
  at("worst camera cam_2, rms 0.9\u00a0px (median 0.25\u00a0px); worst frame 17 of cam_2, rms 1.5\u00a0px");
  EXPECT_THAT(list, Not(HasSubstr("No frame failed")));
  const std::string cards = html.substr(0, html.find("What to fix first"));
  EXPECT_THAT(cards, HasSubstr("<p>too few views</p>")) << "a failed stage shows its error";
  EXPECT_EQ(json_["sentence"], "1 of 2 results failed. First, triangulate: too few views");
  EXPECT_THAT(html, HasSubstr("<p class=\"sentence\">1 of 2 results failed. First, triangulate: too few views</p>"));
}

TEST_F(ReportTest, ARunWithoutWarningsSaysSo) {
  Save("a/dataset_verify.result.json", Result("dataset verify", {{"frames", 4}}));
  Save("b/metrics.result.json", Result("metrics", {{"ssim", 0.5}}));
  EXPECT_THAT(FixListOf(Build().html), AllOf(HasSubstr("No frame failed."), HasSubstr("No warnings.")));
  EXPECT_EQ(json_["sentence"], "All 2 results passed.");
}

TEST_F(ReportTest, CardsHaveRoundedNumbersWithUnits) {
  Save("session/synth.result.json", Result("synth", {{"px_per_s", 10412345.678}}));
  Save("masks/mask.result.json", Result("mask", {{"pictures", 36}, {"flicker", 2.35e-6}}));
  Save("avatar/avatar_train.result.json", Result("avatar train", {{"num_parameters", 3908288}, {"it_per_s", 2.904911}}));
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

TEST_F(ReportTest, PicturesBeyondTheLimitAreNamed) {
  SaveAvatar();
  ReportOptions options;
  options.max_pictures_total_mb = 0;
  const Report report = Build(options);
  EXPECT_THAT(report.html, Not(HasSubstr("data:image/png")));
  EXPECT_THAT(report.warnings, Contains(Field(&Notice::text, HasSubstr("left_00000084.png"))));
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
