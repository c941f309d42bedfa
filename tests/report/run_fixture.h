#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "core/disk/files.h"
#include "report/report.h"
#include "report/viewer/bundle.h"

/// Runs made up of results, for tests of the page.
namespace mvstudio::report {

using Json = nlohmann::ordered_json;

inline constexpr char kHostile[] = "<script>alert(\"x\")</script>&'";

inline Json Result(const std::string& command, const Json& metrics) {
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
    run_ = (std::filesystem::temp_directory_path() / ("mvstudio-report-" + std::to_string(getpid()) + "-" + info->name()))
               .string();
    std::filesystem::remove_all(run_);
    MakeFolder(run_);
  }
  void TearDown() override { std::filesystem::remove_all(run_); }

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
inline std::vector<std::string> SvgFigures(const std::string& html) {
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
inline std::string WithoutViewer(std::string html) {
  const std::string viewer = "<script>" + std::string(ViewerScript()) + "</script>";
  const size_t at = html.find(viewer);
  return at == std::string::npos ? html : html.erase(at, viewer.size());
}

inline void ExpectOffline(const std::string& html) {
  const std::string plain = std::regex_replace(WithoutViewer(html), std::regex(" xmlns=\"http://www.w3.org/2000/svg\""), "");
  for (const char* outside :
       {"http://", "https://", "src=\"//", "@import", "url(", "<script", "<link", "<iframe", "javascript:"}) {
    EXPECT_THAT(plain, ::testing::Not(::testing::HasSubstr(outside)));
  }
}

}  // namespace mvstudio::report
