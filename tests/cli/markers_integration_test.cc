#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include "core/random.h"
#include "dataset/pose/pose3d.h"
#include "dataset/pose/pose3d_trc.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// `markers` as a user runs it.
namespace mvstudio::testing {
namespace {

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

TEST(MarkersCommand, TheRatesOfRunsAndFilesAreNotAskedForAgain) {
  const TempDir folder;
  dataset::Pose3d mouse = Mouse(110, 119);
  mouse.frame_rate_hz = 50;
  dataset::WritePose3d(mouse, folder / "points");
  const CliRun run = RunCli({"markers", folder / "points/points.csv", "--to", "trc,wide,sto,npz", "--filter", "butterworth:5Hz",
                             "--fill", "6", "--frames", "10-115", "--out", folder / "out", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const nlohmann::json markers = run.Json()["metrics"]["markers"], person = markers["persons"][0];
  EXPECT_EQ(markers["rate_hz"], 50);
  EXPECT_EQ(person["first_frame"], 10);
  EXPECT_EQ(person["frames"], 106);
  EXPECT_EQ(person["positions_at_ends"], 6) << "frames 110 to 115";
  EXPECT_EQ(person["joints"]["tail"]["missing_at_end"], 6);
  EXPECT_EQ(person["positions_filled"], 0);
  const nlohmann::json moves = person["largest_moves"];
  ASSERT_GE(moves.size(), 2u);
  EXPECT_GE(moves[0]["moved_mm"], moves[1]["moved_mm"]);
  EXPECT_EQ(moves[0]["moved_mm"], person["moved_max_mm"]);
  EXPECT_TRUE(moves[0].contains("joint") && moves[0].contains("frame"));
  const CliRun other =
      RunCli({"markers", folder / "out/person0.trc", "--to", "csv", "--frame-rate", "25", "--out", folder / "o2", "--json"});
  ASSERT_EQ(other.exit, 0) << other.err;
  EXPECT_THAT(other.Json()["warnings"].dump(), HasSubstr("MRK-RATE"));
  EXPECT_EQ(other.Json()["metrics"]["markers"]["rate_hz"], 25);
  EXPECT_THAT(RunCli({"markers", folder / "points", "--to", "csv", "--frames", "300-310", "--out", folder / "o3"}).err,
              HasSubstr("has no frames 300 to 310; it has 120 frames from 0 to 119"));
}

TEST(MarkersConvert, GoesFromFormatToFormat) {
  const TempDir folder;
  dataset::Pose3d mouse = Mouse(30, 35);
  mouse.frame_rate_hz = 59.94;
  dataset::WritePose3d(mouse, folder / "points");
  std::string from = folder / "points";
  for (const std::string name : {"a.c3d", "b.trc", "c.sto", "d.npz", "e.csv"}) {
    const CliRun run = RunCli({"markers", "convert", from, "--out", folder / name, "--json"});
    ASSERT_EQ(run.exit, 0) << name << ": " << run.err;
    EXPECT_NEAR(run.Json()["metrics"]["converted"]["rate_hz"].get<double>(), 59.94, 1e-3) << name;
    from = folder / name;
  }
  const CliRun back = RunCli({"markers", "convert", from, "--to", "pose3d", "--out", folder / "back"});
  ASSERT_EQ(back.exit, 0) << back.err;
  const dataset::Pose3d pose = dataset::ReadPose3d(folder / "back");
  std::map<std::pair<int, std::string>, Eigen::Vector3d> places;
  for (const dataset::JointRow& row : pose.rows) {
    if (row.status == Status::kOk) places[{row.frame, row.joint}] = row.x_in_world;
  }
  size_t ok = 0;
  for (const dataset::JointRow& row : mouse.rows) {
    if (row.status != Status::kOk) continue;
    ++ok;
    ASSERT_TRUE(places.count({row.frame, row.joint})) << row.frame << row.joint;
    EXPECT_LT((places[{row.frame, row.joint}] - row.x_in_world).norm(), 1e-6) << "single precision of the .c3d";
  }
  EXPECT_EQ(places.size(), ok);
  EXPECT_THAT(RunCli({"markers", "convert", folder / "points", "--out", folder / "m.bvh"}).err, HasSubstr("bones"));
  EXPECT_THAT(RunCli({"markers", "convert", folder / "points", "--out", folder / "m"}).err, HasSubstr("--to"));
  EXPECT_THAT(RunCli({"markers", "convert", folder / "points", "--to-unit", "in", "--out", folder / "m.trc"}).err,
              HasSubstr("--to-unit in: a .trc is written with mm m"));
  for (dataset::JointRow row : std::vector<dataset::JointRow>(mouse.rows)) {
    row.person = 1;
    mouse.rows.push_back(row);
  }
  dataset::WritePose3d(mouse, folder / "two");
  EXPECT_THAT(RunCli({"markers", "convert", folder / "two", "--out", folder / "m.trc"}).err, HasSubstr("persons 0, 1"));
  EXPECT_EQ(RunCli({"markers", "convert", folder / "two", "--person", "1", "--out", folder / "m.trc"}).exit, 0);
  EXPECT_EQ(RunCli({"markers", "convert", folder / "two", "--to", "trc", "--out", folder / "m"}).exit, 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "m/person1.trc"));
}

TEST(MarkersAngles, AndEventsSayWhatJointsDoNotTell) {
  const TempDir folder;
  dataset::Pose3d mouse = Mouse(30, 35);
  mouse.frame_rate_hz = 50;
  dataset::WritePose3d(mouse, folder / "points");
  const CliRun angles = RunCli({"markers", "angles", folder / "points", "--out", folder / "angles"});
  ASSERT_EQ(angles.exit, 0) << angles.err;
  EXPECT_THAT(angles.out, HasSubstr("0 of 36 joint angles"));
  const CliRun events = RunCli({"markers", "events", folder / "points", "--out", folder / "events"});
  ASSERT_EQ(events.exit, 0) << events.err;
  EXPECT_THAT(events.out, HasSubstr("no gait events: both hips"));
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
  EXPECT_THAT(with({"--to", "trc"}).err, HasSubstr("e.g. --frame-rate 60"));
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
