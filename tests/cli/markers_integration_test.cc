#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "body/skeleton.h"
#include "core/random.h"
#include "dataset/pose/pose3d.h"
#include "dataset/pose/pose3d_trc.h"
#include "tests/support/run_cli.h"

/// `markers` as a user runs it.
namespace mvstudio::testing {
namespace {

using ::testing::HasSubstr;

/// A mouse of three joints that BODY_25 does not know; `lost` frames have no tail.
dataset::Pose3d Mouse(int lost_from, int lost_to) {
  dataset::Pose3d pose;
  pose.skeleton = "points";
  Rng rng(4);
  for (int f = 0; f < 120; ++f) {
    for (const char* joint : {"snout", "paw, left", "tail"}) {
      dataset::JointRow row;
      row.frame = f, row.joint = joint;
      if (joint[0] != 't' || f < lost_from || f > lost_to) {
        row.status = Status::kOk, row.num_views = 3, row.sigma_m = 0.002;
        row.x_in_world = {0.2 * std::sin(0.05 * f) + 0.002 * rng.Normal(), 0.01 * joint[0], 0.05 + 0.002 * rng.Normal()};
      }
      pose.rows.push_back(row);
    }
  }
  return pose;
}

TEST(MarkersCommand, EveryJointArrivesFilledAndSmoothed) {
  const TempDir folder;
  dataset::WritePose3d(Mouse(30, 35), folder / "points");
  const CliRun run = RunCli({"markers", folder / "points", "--to", "trc,c3d,csv", "--frame-rate", "100", "--filter",
                             "butterworth:5Hz", "--fill", "6", "--out", folder / "out", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const nlohmann::json person = run.Json()["metrics"]["markers"]["persons"][0];
  EXPECT_EQ(person["positions_filled"], 6);
  EXPECT_EQ(person["joints"]["tail"]["filled"], 6);
  EXPECT_LT(person["filtered_acceleration_m_s2"].get<double>(), 0.2 * person["acceleration_m_s2"].get<double>());
  EXPECT_LT(person["moved_rms_sigmas"].get<double>(), 1.1);
  const dataset::Pose3d back = dataset::ReadTrc(folder / "out/person0.trc");
  EXPECT_EQ(back.rows.size(), 3u * 120);
  for (const dataset::JointRow& row : back.rows) {
    ASSERT_EQ(row.status, Status::kOk);
    EXPECT_NEAR(row.x_in_world.x(), 0.2 * std::sin(0.05 * row.frame), 0.006) << row.frame << " " << row.joint;
  }
  EXPECT_THAT(Slurp(folder / "out/person0.csv"), HasSubstr(",filled\n"));
  EXPECT_THAT(Slurp(folder / "out/markers.html"), HasSubstr("paw, left"));
}

TEST(MarkersCommand, LongGapsStayAndOpenSimSaysWhatItLacks) {
  const TempDir folder;
  dataset::WritePose3d(Mouse(30, 60), folder / "points");
  const CliRun run = RunCli({"markers", folder / "points", "--to", "trc", "--frame-rate", "100", "--fill", "10", "--opensim",
                             "--out", folder / "out", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["markers"]["persons"][0]["positions_in_longer_gaps"], 31);
  EXPECT_THAT(run.Json()["warnings"].dump(), HasSubstr("3 of 3 joints have no place on OpenSim's model"));
}

TEST(MarkersCommand, BadWordsAndForeignFolders) {
  const TempDir folder;
  dataset::WritePose3d(Mouse(0, 0), folder / "points");
  const std::vector<std::string> line = {"markers", folder / "points", "--out", folder / "out"};
  const auto with = [&line](std::vector<std::string> words) {
    words.insert(words.begin(), line.begin(), line.end());
    return RunCli(words);
  };
  EXPECT_THAT(with({"--to", "trc"}).err, HasSubstr("--frame-rate"));
  EXPECT_THAT(with({"--frame-rate", "100"}).err, HasSubstr("--to"));
  EXPECT_THAT(with({"--to", "trc,bvx", "--frame-rate", "100"}).err, HasSubstr("`bvx`"));
  EXPECT_THAT(with({"--to", "trc", "--frame-rate", "8", "--filter", "butterworth:6Hz"}).err, HasSubstr("6 Hz"));
  EXPECT_THAT(with({"--to", "csv", "--frame-rate", "100", "--opensim"}).err, HasSubstr("trc"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  std::filesystem::create_directories(folder / "out");
  std::ofstream(folder / "out/thesis.txt") << "mine";
  EXPECT_EQ(with({"--to", "trc", "--frame-rate", "100", "--overwrite"}).exit, 2);
  EXPECT_EQ(Slurp(folder / "out/thesis.txt"), "mine");
}

}  // namespace
}  // namespace mvstudio::testing
