#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "dataset/time/sync_file.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/run_cli.h"
#include "tests/triangulate/support.h"

/// `triangulate` and `tradeoff triangulate` as a user runs them.
namespace mvstudio::testing {
namespace {

using ::testing::HasSubstr;

constexpr int kFrames = 60;

/// Where a walking BODY_25 stands, metres; stiff but for its arms and legs.
Eigen::Vector3d JointAt(double frame, int joint) {
  const double along = -0.4 + 0.8 * frame / kFrames, swing = 0.15 * std::sin(0.3 * frame);
  return {along + (joint % 3 - 1) * (0.2 + swing), 0.15 * (joint % 5 - 2), -0.8 + 0.07 * joint};
}

struct Take {
  geometry::Rig rig = triangulate::MakeRing(5);
  geometry::Skeleton skeleton = geometry::SkeletonByName("body25");
  std::vector<dataset::Pose2dTrack> tracks;

  /// `late_frames`: the second camera's image f shows what is at f + late_frames.
  explicit Take(double noise_px = 1, double late_frames = 0) {
    Rng rng(31);
    for (const geometry::RigCamera& camera : rig.cameras) {
      dataset::Pose2dTrack& track = tracks.emplace_back();
      track.camera = camera.camera.name;
      for (int f = 0; f < kFrames; ++f) {
        dataset::Person2d person;
        for (int j = 0; j < 25; ++j) {
          const double time_step = f + (&camera == &rig.cameras[1] ? late_frames : 0);
          const Eigen::Vector2d px = geometry::Project(camera.camera, camera.cam_from_world * JointAt(time_step, j)).px;
          person.keypoints.push_back({px.x() + noise_px * rng.Normal(), px.y() + noise_px * rng.Normal(), 0.9});
        }
        track.frames[f] = {person};
      }
    }
  }

  /// Several people, filmed without distortion; the calibration lists one all the same, as a file found in the wild does.
  void ListDistortionThatIsNot(int num_people, double noise_px = 1) {
    Rng rng(5);
    for (size_t c = 0; c < tracks.size(); ++c) {
      geometry::RigCamera& camera = rig.cameras[c];
      const geometry::Camera pinhole = geometry::PinholeOf(camera.camera);
      for (int f = 0; f < kFrames; ++f) {
        auto& people = tracks[c].frames[f] = {};
        for (int i = 0; i < num_people; ++i) {
          dataset::Person2d& person = people.emplace_back();
          const Eigen::Vector3d place(0, 0.9 * (i - 0.5 * (num_people - 1)), 0.1 * i);
          for (int j = 0; j < 25; ++j) {
            const Eigen::Vector2d px = geometry::Project(pinhole, camera.cam_from_world * (JointAt(f, j) + place)).px;
            person.keypoints.push_back({px.x() + noise_px * rng.Normal(), px.y() + noise_px * rng.Normal(), 0.9});
          }
        }
      }
      const double sign = c % 2 ? -1 : 1;
      camera.camera.params.tail<5>() << -0.05, 0.02, sign * 6.459, -sign * 3.1, 0.3;
    }
  }

  /// Files of the take and the words that name them on the command line.
  std::vector<std::string> Write(const TempDir& folder) const {
    geometry::WriteRig(rig, folder / "calibration.json");
    std::vector<std::string> words = {"--calib", folder / "calibration.json"};
    for (const dataset::Pose2dTrack& track : tracks) {
      dataset::WriteOpenPoseFolder(track, folder / track.camera);
      words.insert(words.end(), {"--pose2d", track.camera + "=" + (folder / track.camera)});
    }
    return words;
  }
};

std::vector<std::string> Words(std::vector<std::string> first, const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

double WorstErrorMm(const std::string& folder) {
  double worst = 0;
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  for (const dataset::JointRow& row : dataset::ReadPose3d(folder).rows) {
    if (row.status != Status::kOk) continue;
    worst = std::max(worst, (row.x_in_world - JointAt(row.frame, skeleton.Find(row.joint))).norm());
  }
  return 1000 * worst;
}

TEST(TriangulateCommand, GivesPointsAndWhatTheOthersSayOfEachCamera) {
  const TempDir folder;
  const CliRun run = RunCli(Words({"triangulate", "--out", folder / "out", "--json"}, Take().Write(folder)));
  ASSERT_EQ(run.exit, 0) << run.err;
  const nlohmann::json metrics = run.Json()["metrics"];
  EXPECT_EQ(metrics["num_points"], kFrames * 25);
  EXPECT_NEAR(metrics["sigma_px"].get<double>(), 1, 0.05);
  EXPECT_EQ(metrics["holdout"]["cameras"].size(), 5u);
  EXPECT_EQ(metrics["holdout"]["joints"].size(), 25u);
  EXPECT_EQ(metrics["holdout"]["coverage"], 1.0);
  // Two coordinates of the detection's own noise and what the point adds.
  EXPECT_GT(metrics["holdout"]["median_px"].get<double>(), 1.17);
  EXPECT_LT(metrics["holdout"]["median_px"].get<double>(), 1.7);
  EXPECT_LT(WorstErrorMm(folder / "out"), 25);
}

/// A distortion that the published images no longer have: once 52 joints of 7,000, "warn" and exit 0.
TEST(TriangulateCommand, ALostTakeNamesItsCause) {
  const TempDir folder;
  Take take;
  take.ListDistortionThatIsNot(3);
  const CliRun run =
      RunCli(Words({"triangulate", "--max-persons", "3", "--out", folder / "out", "--json"}, take.Write(folder)));
  EXPECT_TRUE(run.exit == 4 || run.exit == 5) << run.out;  // few points, or none
  const nlohmann::json json = run.Json();
  EXPECT_LT(json["metrics"]["num_points"].get<double>(), 0.05 * json["metrics"]["num_joints_carriable"].get<double>());
  EXPECT_THAT(json["errors"].dump(), ::testing::AnyOf(HasSubstr("TRI-LOST"), HasSubstr("TRI-NO-POINTS")));
  EXPECT_THAT(json["errors"].dump(), HasSubstr("--ignore-distortion"));
  EXPECT_THAT(json["warnings"].dump(), HasSubstr("CAL-DECENTRING"));
  EXPECT_THAT(json["warnings"].dump(), HasSubstr("likeliest cause: without distortion"));
  EXPECT_EQ(json["metrics"]["causes"][1]["cause"], "distortion");
  EXPECT_TRUE(std::filesystem::exists(folder / "out/points.csv"));  // what there is is kept
}

TEST(TriangulateCommand, NoCauseIsSoughtWhereTheTakeFits) {
  const TempDir folder;
  Take take;
  take.ListDistortionThatIsNot(3);
  const CliRun run = RunCli(Words(
      {"triangulate", "--ignore-distortion", "--max-persons", "3", "--out", folder / "out", "--json"}, take.Write(folder)));
  EXPECT_EQ(run.exit, 0) << run.out;
  EXPECT_GT(run.Json()["metrics"]["num_points"].get<double>(), 0.9 * kFrames * 75);
  EXPECT_FALSE(run.Json()["metrics"].contains("causes"));
}

TEST(TriangulateCommand, ChunksGiveThePointsOfTheWhole) {
  const TempDir folder;
  const std::vector<std::string> words = Words({"triangulate", "--sigma-px", "1", "--method", "robust"}, Take().Write(folder));
  ASSERT_EQ(RunCli(Words(words, {"--out", folder / "whole"})).exit, 0);
  ASSERT_EQ(RunCli(Words(words, {"--out", folder / "parts", "--chunk-frames", "17"})).exit, 0);
  EXPECT_EQ(Slurp(folder / "whole/points.csv"), Slurp(folder / "parts/points.csv"));
  EXPECT_EQ(Slurp(folder / "whole/covariance.csv"), Slurp(folder / "parts/covariance.csv"));
}

TEST(TriangulateCommand, WritesMarkersOfEveryJointAtOnce) {
  const TempDir folder;
  const std::vector<std::string> words = Words({"triangulate", "--out", folder / "out", "--json"}, Take().Write(folder));
  EXPECT_EQ(RunCli(Words(words, {"--fill", "5"})).exit, 2);  // of what files?
  const std::vector<std::string> markers = {"--to",     "trc",    "--frame-rate", "50",
                                            "--filter", "kalman", "--opensim",    "--overwrite"};
  for (int time = 0; time < 2; ++time) {  // and once more over its own
    const CliRun run = RunCli(Words(words, markers));
    ASSERT_EQ(run.exit, 0) << run.err;
    EXPECT_EQ(run.Json()["metrics"]["markers"]["persons"][0]["joints"].size(), 25u);
  }
  EXPECT_THAT(Slurp(folder / "out/markers/person0.trc"), HasSubstr("LBigToe"));
  EXPECT_THAT(Slurp(folder / "out/markers/person0.ik.xml"), HasSubstr("RHeel"));
  std::ofstream(folder / "out/markers/thesis.txt") << "mine";
  EXPECT_EQ(RunCli(Words(words, markers)).exit, 2);
  EXPECT_EQ(Slurp(folder / "out/markers/thesis.txt"), "mine");
}

/// Markers of points that are replaced go, unless somebody put something among them.
TEST(TriangulateCommand, MarkersOfOlderPointsDoNotStay) {
  const TempDir folder;
  const std::vector<std::string> words =
      Words({"triangulate", "--out", folder / "out", "--overwrite", "--json"}, Take().Write(folder));
  const std::vector<std::string> markers = {"--to", "trc", "--frame-rate", "50"};
  ASSERT_EQ(RunCli(Words(words, markers)).exit, 0);
  ASSERT_EQ(RunCli(words).exit, 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "out/markers"));
  ASSERT_EQ(RunCli(Words(words, markers)).exit, 0);
  std::ofstream(folder / "out/markers/thesis.txt") << "mine";
  const CliRun run = RunCli(words);
  EXPECT_EQ(run.exit, 0);
  EXPECT_THAT(run.Json()["warnings"].dump(), HasSubstr("TRI-OLD-MARKERS"));
  EXPECT_EQ(Slurp(folder / "out/markers/thesis.txt"), "mine");
  EXPECT_TRUE(std::filesystem::exists(folder / "out/markers/person0.trc"));
}

/// What a filter does to the distance from a reference is said beside that of the points.
TEST(TriangulateCommand, ComparesWhatItWrites) {
  const TempDir folder;
  const std::vector<std::string> words = Take().Write(folder);
  ASSERT_EQ(RunCli(Words({"triangulate", "--out", folder / "a"}, words)).exit, 0);
  const CliRun run = RunCli(Words({"triangulate", "--out", folder / "b", "--truth", folder / "a", "--to", "csv", "--frame-rate",
                                   "50", "--filter", "median:5", "--json"},
                                  words));
  ASSERT_EQ(run.exit, 0) << run.err;
  const auto truth = run.Json()["metrics"]["truth"];
  EXPECT_LT(truth["max_mm"].get<double>(), 1e-6);
  EXPECT_GT(truth["written"]["median_mm"].get<double>(), 0.1) << "a median moves points";
  EXPECT_EQ(truth["written"]["num"], truth["num"]);
}

TEST(TriangulateCommand, OneDamagedFileLosesNothingElse) {
  const TempDir folder;
  const std::vector<std::string> words = Take().Write(folder);
  std::filesystem::resize_file(folder / "cam_2/000000000007_keypoints.json", 40);
  std::ofstream(folder / "cam_3/000000000009_keypoints.json").flush();
  const CliRun run = RunCli(Words({"triangulate", "--out", folder / "out", "--json"}, words));
  EXPECT_EQ(run.exit, 6) << run.err;
  EXPECT_THAT(run.out, HasSubstr("000000000007_keypoints.json"));
  EXPECT_THAT(run.out, HasSubstr("000000000009_keypoints.json"));
  EXPECT_EQ(run.Json()["metrics"]["num_points"], kFrames * 25);
}

TEST(TriangulateCommand, TakesATableOfPointsOfAnyKind) {
  const TempDir folder;
  Take take;
  take.Write(folder);
  dataset::WritePose2dCsv({take.skeleton, take.tracks}, folder / "points.csv");
  const CliRun run = RunCli({"triangulate", "--calib", folder / "calibration.json", "--points2d", folder / "points.csv",
                             "--out", folder / "out", "--json"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["num_points"], kFrames * 25);
  EXPECT_EQ(dataset::ReadPose3d(folder / "out").skeleton, "points");
}

TEST(TriangulateCommand, NamesTheCameraThatSwapsLeftAndRight) {
  const TempDir folder;
  Take take;
  for (auto& [frame, people] : take.tracks[1].frames) {
    auto& keys = people[0].keypoints;
    for (const auto& [left, right] : geometry::MirrorJoints(take.skeleton)) std::swap(keys[left], keys[right]);
  }
  const CliRun run = RunCli(Words({"triangulate", "--out", folder / "out", "--json"}, take.Write(folder)));
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("TRI-SIDES-SWAPPED"));
  EXPECT_THAT(run.out, HasSubstr("cam_1: left and right"));
  EXPECT_LT(WorstErrorMm(folder / "out"), 25);
}

TEST(TriangulateCommand, ACameraGivenTwiceIsNamedAndAddsNothing) {
  const TempDir folder;
  Take take;
  const CliRun once =
      RunCli(Words({"triangulate", "--method", "robust", "--out", folder / "once", "--json"}, take.Write(folder)));
  take.rig.cameras.push_back(take.rig.cameras[0]);
  take.rig.cameras.back().camera.name = "copy";
  take.tracks.push_back(take.tracks[0]);
  take.tracks.back().camera = "copy";
  const CliRun twice =
      RunCli(Words({"triangulate", "--method", "robust", "--out", folder / "twice", "--json"}, take.Write(folder)));
  ASSERT_EQ(twice.exit, 0) << twice.err;
  EXPECT_THAT(twice.out, HasSubstr("TRI-DUPLICATE"));
  EXPECT_NEAR(twice.Json()["metrics"]["median_sigma_mm"].get<double>(), once.Json()["metrics"]["median_sigma_mm"].get<double>(),
              0.02);
}

/// Gives every camera but those in `without` a covariance: 0.1 px and 1 mm.
void GiveCovariances(const std::vector<size_t>& without, geometry::Rig* rig) {
  for (size_t c = 0; c < rig->cameras.size(); ++c) {
    geometry::RigCamera& camera = rig->cameras[c];
    camera.params_covariance.reset(), camera.cam_from_world_covariance.reset();
    if (std::find(without.begin(), without.end(), c) != without.end()) continue;
    const Eigen::Index p = camera.camera.params.size();
    camera.params_covariance = Eigen::MatrixXd::Zero(p, p);
    camera.params_covariance->diagonal().head<4>().setConstant(0.01);
    camera.cam_from_world_covariance = 1e-6 * Eigen::Matrix<double, 6, 6>::Identity();
  }
}

TEST(TriangulateCommand, SaysWhoseCalibrationErrorIsUnknown) {
  Take take(0.2);
  const auto run = [&](const std::vector<size_t>& without, std::vector<std::string> more = {}) {
    const TempDir folder;
    GiveCovariances(without, &take.rig);
    more.insert(more.end(), {"--out", folder / "out", "--json"});
    const CliRun ran = RunCli(Words(Words({"triangulate"}, take.Write(folder)), more));
    EXPECT_EQ(ran.exit, 0) << ran.out << ran.err;
    nlohmann::json json = ran.Json();
    EXPECT_EQ(dataset::ReadPose3d(folder / "out").covariance_note, json["metrics"]["calibration_covariance"]["reason"]);
    nlohmann::json& warnings = json["warnings"];  // JointAt is no person, and says so
    warnings.erase(std::remove_if(warnings.begin(), warnings.end(),
                                  [](const nlohmann::json& w) { return w["code"] == "TRI-LIMBS" || w["code"] == "TRI-UP"; }),
                   warnings.end());
    return json;
  };
  const nlohmann::json whole = run({}), partial = run({1}), none = run({0, 1, 2, 3, 4}),
                       off = run({}, {"--no-calibration-covariance"});
  const auto sigma = [](const nlohmann::json& json) { return json["metrics"]["median_sigma_mm"].get<double>(); };
  EXPECT_TRUE(whole["metrics"]["calibration_covariance"]["used"]);
  EXPECT_TRUE(whole["warnings"].empty()) << whole["warnings"];
  EXPECT_EQ(whole["metrics"]["num_sigma_lower_bounds"], 0);
  EXPECT_TRUE(partial["metrics"]["calibration_covariance"]["used"]);
  ASSERT_EQ(partial["metrics"]["calibration_covariance"]["missing"].size(), 1u);
  EXPECT_EQ(partial["metrics"]["calibration_covariance"]["missing"][0]["camera"], take.rig.cameras[1].camera.name);
  EXPECT_EQ(partial["metrics"]["calibration_covariance"]["missing"][0]["lacks"], "lens and pose");
  EXPECT_GT(partial["metrics"]["num_sigma_lower_bounds"], 1000);
  ASSERT_EQ(partial["warnings"].size(), 1u);
  EXPECT_EQ(partial["warnings"][0]["code"], "CAL-COVARIANCE-MISSING");
  EXPECT_FALSE(none["metrics"]["calibration_covariance"]["used"]);
  EXPECT_FALSE(off["metrics"]["calibration_covariance"]["used"]);
  EXPECT_GT(sigma(partial), 0.6 * sigma(whole)) << "one missing block does not drop the others";
  EXPECT_LT(sigma(none), 0.5 * sigma(whole));
}

TEST(TriangulateCommand, AppliesTheOffsetsOfTheCalibrationWhereTheTakeConfirmsThem) {
  const auto run = [](double late_frames, std::vector<std::string> more) {
    const TempDir folder;
    Take take(0.5, late_frames);
    take.rig.cameras[1].time_offset = geometry::TimeOffset{-0.6, 0.01};
    if (more == std::vector<std::string>{"--sync"}) {
      dataset::SyncFile sync;
      sync.reference = take.rig.cameras[0].camera.name;
      for (const geometry::RigCamera& camera : take.rig.cameras)
        sync.cameras.push_back({camera.camera.name, "Ok", &camera == &take.rig.cameras[1] ? -late_frames : 0.0, 0});
      dataset::WriteSync(sync, folder / "sync.json");
      more.push_back(folder / "sync.json");
    }
    more.insert(more.end(), {"--out", folder / "out", "--json"});
    return RunCli(Words(Words({"triangulate"}, take.Write(folder)), more)).Json();
  };
  const nlohmann::json late = run(0.6, {}), still = run(0, {}), on = run(0, {"--calibration-offsets", "on"}),
                       own = run(0.6, {"--sync"});
  EXPECT_TRUE(late["metrics"]["calibration_offsets"]["applied"]) << late["metrics"]["calibration_offsets"];
  EXPECT_FALSE(still["metrics"]["calibration_offsets"]["applied"]);
  EXPECT_EQ(still["warnings"][0]["code"], "TRI-OFFSETS-UNUSED");
  EXPECT_TRUE(on["metrics"]["calibration_offsets"]["applied"]);
  EXPECT_FALSE(own["metrics"]["calibration_offsets"]["applied"]) << "not twice";
  const auto rms = [](const nlohmann::json& json) { return json["metrics"]["median_rms_px"].get<double>(); };
  EXPECT_NEAR(rms(late), rms(still), 0.2);
  EXPECT_NEAR(rms(own), rms(late), 0.05) << "applied once either way";
  EXPECT_GT(rms(on), 1.3 * rms(still));
}

TEST(TriangulateCommand, BadArgumentsEndWithTheirExitCodes) {
  const TempDir folder;
  const std::vector<std::string> words = Take().Write(folder);
  EXPECT_EQ(RunCli(Words({"triangulate", "--out", folder / "o", "--method", "guess"}, words)).exit, 2);
  EXPECT_EQ(RunCli(Words({"triangulate", "--out", folder / "o", "--chunk-frames", "-1"}, words)).exit, 2);
  EXPECT_EQ(RunCli(Words({"triangulate", "--out", folder / "o", "--points2d", folder / "none.csv"}, words)).exit, 2);
  EXPECT_EQ(RunCli(Words({"triangulate", "--out", folder / "o", "--trc", folder / "none.trc"}, words)).exit, 3);
  const CliRun joints = RunCli(Words({"triangulate", "--out", folder / "o", "--skeleton", "coco17"}, words));
  EXPECT_EQ(joints.exit, 3);
  EXPECT_THAT(joints.err, HasSubstr("body25"));
  EXPECT_FALSE(std::filesystem::exists(folder / "o/points.csv"));
}

TEST(TradeoffTriangulate, ListsEveryWayWithItsErrors) {
  const TempDir folder;
  const CliRun run = RunCli(Words({"tradeoff", "triangulate", "--methods", "robust,midpoint", "--precisions", "double,float",
                                   "--views", "0,2", "--threads-list", "1", "--out", folder / "out", "--json"},
                                  Take().Write(folder)));
  ASSERT_EQ(run.exit, 0) << run.err;
  const nlohmann::json trials = run.Json()["metrics"]["trials"];
  ASSERT_EQ(trials.size(), 8u);
  EXPECT_EQ(trials[2]["precision"], "float");
  EXPECT_NEAR(trials[2]["holdout_median_px"].get<double>(), trials[0]["holdout_median_px"].get<double>(), 1e-2);
  EXPECT_LT(trials[0]["holdout_median_px"].get<double>(), trials[1]["holdout_median_px"].get<double>()) << "5 views beat 2";
  EXPECT_THAT(Slurp(folder / "out/tradeoff-triangulate.html"), HasSubstr("<svg"));
}

TEST(TradeoffTriangulate, TheUnitOfTheTruthIsWhatIsTyped) {
  const TempDir folder;
  const std::vector<std::string> words = Take().Write(folder);
  ASSERT_EQ(RunCli(Words({"triangulate", "--out", folder / "a", "--to", "trc", "--frame-rate", "50"}, words)).exit, 0);
  const auto median_mm = [&](const std::vector<std::string>& unit) {
    const CliRun run =
        RunCli(Words(Words({"tradeoff", "triangulate", "--methods", "robust", "--precisions", "double", "--views", "0",
                            "--threads-list", "1", "--truth", folder / "a/markers/person0.trc", "--json"},
                           words),
                     unit));
    return run.exit == 0 ? run.Json()["metrics"]["trials"][0]["truth_median_mm"].get<double>() : -1.0;
  };
  const double stated_mm = median_mm({}), wrong_mm = median_mm({"--marker-unit", "cm"});
  EXPECT_GE(stated_mm, 0);
  EXPECT_GT(wrong_mm, 100 + stated_mm) << "ten times as far from the origin";
}

}  // namespace
}  // namespace mvstudio::testing
