#include "stages/calib/calibrate_result.h"

#include <cmath>

#include "tests/support/test.h"
#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

TEST(CalibrateResult, AVerdictAsJson) {
  EXPECT_EQ(VerdictJson({}).dump(), R"({"status":"pass","reasons":[]})");
  calib::Verdict verdict;
  verdict.reasons = {{"CAL-A", "first", "hint"}, {"CAL-B", "second", ""}};
  EXPECT_EQ(VerdictJson(verdict).dump(), R"({"status":"warn","reasons":[{"level":"warn","code":"CAL-A","text":"first"},)"
                                         R"({"level":"warn","code":"CAL-B","text":"second"}]})");
  EXPECT_EQ(VerdictLine(verdict), "verdict: warn: first (CAL-A)\n");
  verdict.reasons.push_back({"CAL-C", "third", "", true});
  verdict.reasons.push_back({"CAL-D", "fourth", "", true});
  EXPECT_EQ(VerdictLine(verdict), "verdict: fail: third (CAL-C) and 1 more\n");
}

/// A held-out board is of the lens alone: a camera that contradicts the others has its error in the rig.
TEST(CalibrateResult, TheWorstCameraIsTheWorseOfHeldOutAndRig) {
  calib::CalibrateReport report;
  const double rms[] = {0.3, 2.6, 1.1}, held_out[] = {0.5, 0.6, 1.5};
  for (int c = 0; c < 3; ++c) {
    calib::CameraReport camera;
    camera.name = std::string(1, static_cast<char>('a' + c)), camera.focal_px = 1000;
    camera.rms_px = rms[c], camera.holdout_rms_px = held_out[c];
    report.rig.cameras.push_back(triangulate::LookAt(camera.name, {1.0 * c, 3, 0}, {1.0 * c, 0, 0}));
    report.cameras.push_back(camera);
  }
  EXPECT_THAT(CalibrateSummary(report), HasSubstr("worst camera: b, 2.600 px beside a median of 1.500 px"));
}

TEST(CalibrateResult, WhatIsNotDeterminedYetIsSaid) {
  calib::CalibrateReport report;
  report.cameras.emplace_back().name = "a";
  const CommandResult result = DescribeFilmGain(report, {{0, {}, std::nan(""), 1.19}});
  EXPECT_THAT(result.text, HasSubstr("from what is not determined to 1.19 px"));
}

TEST(CalibrateResult, ASigmaThatIsNotKnownIsNeitherShownNorZero) {
  calib::CalibrateReport report;
  for (const double x : {0.0, 1.5}) {
    const std::string name = x == 0 ? "left" : "right";
    report.rig.cameras.push_back(triangulate::LookAt(name, {x, 3, 0}, {x, 0, 0}));
    calib::CameraReport camera;
    camera.name = name, camera.focal_px = 1000, camera.focal_sigma_px = 0.25, camera.holdout_rms_px = std::nan("");
    report.cameras.push_back(camera);
  }
  report.rig.cameras[0].params_covariance = Eigen::MatrixXd::Identity(4, 4);
  const nlohmann::json json = nlohmann::json::parse(CalibrateMetrics(report, {}).dump());
  EXPECT_NEAR(json["baseline_mm"].get<double>(), 1500, 1e-9);
  EXPECT_EQ(json["cameras"][0]["focal_sigma_px"], 0.25);
  EXPECT_TRUE(json["cameras"][1]["focal_sigma_px"].is_null());
  EXPECT_TRUE(json["cameras"][0]["holdout_rms_px"].is_null());
  const std::string text = CalibrateSummary(report);
  for (const char* words : {"left ", "0.25", "baseline 1500.000 mm", "verdict: pass\n"}) {
    EXPECT_THAT(text, HasSubstr(words));
  }
  const size_t line = text.find("right ");
  EXPECT_THAT(text.substr(line, text.find('\n', line) - line), HasSubstr("? "));
}

}  // namespace
}  // namespace mvstudio::stages
