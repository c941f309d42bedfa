#include "stages/calib/calibrate_result.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

using ::testing::HasSubstr;

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
