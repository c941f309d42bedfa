#include "tests/support/run_cli.h"
#include "tests/support/test.h"

namespace mvstudio::testing {
namespace {

TEST(Demo, QuickOneRunsTheWholeRoad) {
  TempDir work;
  const CliRun run = RunCli({"demo", "--quick", "--out", work / "demo", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const nlohmann::json json = run.Json();
  const nlohmann::json& truth = json["metrics"]["truth"];
  EXPECT_LT(truth["rig_rotation_deg"].get<double>(), 0.2);
  EXPECT_LT(truth["rig_translation_mm"].get<double>(), 8);
  EXPECT_LT(truth["joints_median_mm"].get<double>(), 10);
  for (const char* file : {"report.html", "report.json", "mvstudio.toml", "calib/calibration.json", "pose3d/take1/points.csv",
                           "dataset/take1/dataset.json", "avatar/take1/checkpoint.safetensors", "provenance.jsonl"}) {
    EXPECT_TRUE(std::filesystem::exists(work / "demo/" + file)) << file;
  }
  for (const nlohmann::json& warning : json["warnings"]) {
    const std::string code = warning["code"];
    EXPECT_NE(code.substr(0, 4), "CAL-") << warning << ": the studio's cameras are synchronous and well filmed";
  }
  // A second demo into the same folder is refused unless asked for.
  EXPECT_EQ(RunCli({"demo", "--quick", "--out", work / "demo"}).exit, 2);
}

}  // namespace
}  // namespace mvstudio::testing
