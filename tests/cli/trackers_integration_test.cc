#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/format.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig_io.h"
#include "tests/dataset/c3d_sample.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// Animals, from the files that DeepLabCut and SLEAP write to points in space, as a user runs it.
namespace mvstudio::testing {
namespace {

constexpr int kFrames = 40;
const std::vector<std::string> kJoints = {"nose", "left ear", "right ear", "tail base"};

/// Two mice that walk beside each other, metres.
Eigen::Vector3d JointAt(double frame, int mouse, int joint) {
  const double along = -0.3 + 0.6 * frame / kFrames + 0.05 * std::sin(0.5 * frame + mouse);
  return {along - 0.07 * (joint == 3), 0.35 * (mouse - 0.5) + 0.03 * (joint - 1.5),
          0.02 * joint + 0.01 * std::cos(0.9 * frame)};
}

struct Mice {
  geometry::Rig rig = triangulate::MakeRing(4, 1.2);
  double noise_px = 0.5;

  /// x, y of a joint in a camera.
  Eigen::Vector2d Pixel(size_t camera, int frame, int mouse, int joint, double late, Rng* rng) const {
    const geometry::RigCamera& c = rig.cameras[camera];
    const double time_step = frame + (camera == 1 ? late : 0);
    const Eigen::Vector2d px = geometry::Project(c.camera, c.cam_from_world * JointAt(time_step, mouse, joint)).px;
    return {px.x() + noise_px * rng->Normal(), px.y() + noise_px * rng->Normal()};
  }

  std::vector<std::string> Words(const TempDir& folder, const char* extension) const {
    geometry::WriteRig(rig, folder / "calibration.json");
    std::vector<std::string> words = {"--calib", folder / "calibration.json"};
    for (const geometry::RigCamera& camera : rig.cameras) {
      const std::string& name = camera.camera.name;
      words.insert(words.end(), {"--pose2d", name + "=" + (folder / (name + extension))});
    }
    return words;
  }

  /// DeepLabCut's table of each camera; one mouse is written without the row `individuals`.
  std::vector<std::string> WriteDeepLabCut(const TempDir& folder, int mice, double late = 0) const {
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      Rng rng(20 + c);
      std::string scorer = "scorer", individuals = "individuals", parts = "bodyparts", coords = "coords", rows;
      for (int m = 0; m < mice; ++m) {
        for (const std::string& joint : kJoints) {
          for (const char* coord : {"x", "y", "likelihood"}) {
            scorer += ",DLC_net", individuals += ",mouse" + std::to_string(m), parts += "," + joint;
            coords += std::string(",") + coord;
          }
        }
      }
      for (int f = 0; f < kFrames; ++f) {
        rows += std::to_string(f);
        for (int m = 0; m < mice; ++m) {
          for (int j = 0; j < 4; ++j) {
            const Eigen::Vector2d px = Pixel(c, f, m, j, late, &rng);
            rows += Format(",%.17g,%.17g,0.98", px.x(), px.y());
          }
        }
        rows += "\n";
      }
      std::ofstream(folder / (rig.cameras[c].camera.name + ".csv")) << scorer << "\n"
                                                                    << (mice > 1 ? individuals + "\n" : "") << parts << "\n"
                                                                    << coords << "\n"
                                                                    << rows;
    }
    return Words(folder, ".csv");
  }

  /// The same numbers as SLEAP's table.
  std::vector<std::string> WriteSleap(const TempDir& folder, int mice) const {
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      Rng rng(20 + c);
      std::string text = "track,frame_idx,instance.score";
      for (const std::string& joint : kJoints) text += "," + joint + ".x," + joint + ".y," + joint + ".score";
      text += "\n";
      for (int f = 0; f < kFrames; ++f) {
        for (int m = 0; m < mice; ++m) {
          text += Format("track_%d,%d,1", m, f);
          for (int j = 0; j < 4; ++j) {
            const Eigen::Vector2d px = Pixel(c, f, m, j, 0, &rng);
            text += Format(",%.17g,%.17g,0.98", px.x(), px.y());
          }
          text += "\n";
        }
      }
      std::ofstream(folder / (rig.cameras[c].camera.name + ".sleap.csv")) << text;
    }
    return Words(folder, ".sleap.csv");
  }
};

std::vector<std::string> Join(std::vector<std::string> first, const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// The largest distance of a joint from the nearer mouse's.
double WorstMm(const std::string& folder) {
  double worst = 0;
  for (const dataset::JointRow& row : dataset::ReadPose3d(folder).rows) {
    if (row.status != Status::kOk) continue;
    const int joint = static_cast<int>(std::find(kJoints.begin(), kJoints.end(), row.joint) - kJoints.begin());
    worst = std::max(worst, std::min((row.x_in_world - JointAt(row.frame, 0, joint)).norm(),
                                     (row.x_in_world - JointAt(row.frame, 1, joint)).norm()));
  }
  return 1000 * worst;
}

TEST(Trackers, TwoMiceOfDeepLabCutBecomePointsInSpace) {
  const TempDir folder;
  const std::vector<std::string> words = Mice().WriteDeepLabCut(folder, 2);
  const CliRun run = RunCli(Join({"triangulate", "--max-persons", "2", "--out", folder / "out", "--json"}, words));
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["num_points"], 2 * 4 * kFrames);
  EXPECT_THAT(run.out, HasSubstr("2 individuals (mouse0, mouse1)"));
  EXPECT_THAT(run.out, Not(HasSubstr("TRI-PERSONS-LEFT-OUT")));
  EXPECT_LT(WorstMm(folder / "out"), 5);
}

TEST(Trackers, AnimalsBeyondTheNumberKeptAreCounted) {
  const TempDir folder;
  const CliRun run = RunCli(Join({"triangulate", "--out", folder / "out", "--json"}, Mice().WriteDeepLabCut(folder, 2)));
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["num_points"], 4 * kFrames);
  EXPECT_THAT(run.out, HasSubstr("see up to 2 people at once, in 40 of 40 frames; --max-persons 1"));
}

TEST(Trackers, SleapGivesTheSamePointsAsDeepLabCut) {
  const TempDir folder;
  const Mice mice;
  ASSERT_EQ(RunCli(Join({"triangulate", "--out", folder / "dlc"}, mice.WriteDeepLabCut(folder, 1))).exit, 0);
  ASSERT_EQ(RunCli(Join({"triangulate", "--out", folder / "sleap"}, mice.WriteSleap(folder, 1))).exit, 0);
  EXPECT_EQ(Slurp(folder / "dlc/points.csv"), Slurp(folder / "sleap/points.csv"));
  EXPECT_LT(WorstMm(folder / "dlc"), 5);
}

TEST(Trackers, SyncAndRefineTakeTheSameFiles) {
  const TempDir folder;
  Mice mice;
  mice.noise_px = 0.1;
  const std::vector<std::string> words = mice.WriteDeepLabCut(folder, 1, 4);
  const CliRun sync =
      RunCli(Join({"sync", "--max-offset-frames", "8", "--min-frames", "10", "--out", folder / "sync", "--json"}, words));
  ASSERT_EQ(sync.exit, 0) << sync.out << sync.err;
  for (const auto& camera : sync.Json()["metrics"]["cameras"]) {
    const double other = sync.Json()["metrics"]["reference"] == "cam_1" ? 4 : 0;
    EXPECT_NEAR(camera["offset_frames"].get<double>(), camera["name"] == "cam_1" ? other - 4 : other, 0.1) << camera;
  }
  const std::vector<std::string> whole = mice.WriteDeepLabCut(folder, 1);
  const std::vector<std::string> pose2d(whole.begin() + 2, whole.end());
  const CliRun refined = RunCli(Join(
      {"calib", "refine", "--calib", folder / "calibration.json", "--from-keypoints", "--out", folder / "refined", "--json"},
      pose2d));
  EXPECT_TRUE(refined.exit == 0 || refined.exit == 4) << refined.out << refined.err;
  EXPECT_EQ(refined.Json()["metrics"]["status"], "Ok") << refined.out;
}

TEST(Trackers, MarkersAreTruth) {
  const TempDir folder;
  ASSERT_EQ(RunCli(Join({"triangulate", "--out", folder / "out"}, Mice().WriteDeepLabCut(folder, 1))).exit, 0);
  dataset::C3dSample sample;
  sample.labels = kJoints;
  for (int f = 0; f < kFrames; ++f) {
    std::vector<double>& frame = sample.frames.emplace_back();
    for (int j = 0; j < 4; ++j) {
      const Eigen::Vector3d x = 1000 * JointAt(f, 0, j);
      frame.insert(frame.end(), {x.x(), x.y(), x.z(), 0});
    }
  }
  std::ofstream(folder / "truth.c3d", std::ios::binary) << sample.Bytes();
  const CliRun run = RunCli(Join({"triangulate", "--truth", folder / "truth.c3d", "--out", folder / "out2", "--json"},
                                 Mice().WriteDeepLabCut(folder, 1)));
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const nlohmann::json truth = run.Json()["metrics"]["truth"];
  EXPECT_EQ(truth["num"], 4 * kFrames);
  EXPECT_LT(truth["median_mm"].get<double>(), 1.5);
  EXPECT_EQ(truth["unit"], "mm");
  EXPECT_EQ(truth["up"], "z");
}

TEST(Trackers, WhatCannotBeReadEndsWithOneLineThatSaysWhatToDo) {
  const TempDir folder;
  const Mice mice;
  std::vector<std::string> words = Join({"triangulate", "--out", folder / "out"}, mice.WriteDeepLabCut(folder, 1));
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  std::filesystem::copy_file(std::string(source ? source : ".") + "/tests/fuzz/seeds/tracker_hdf5/project.slp",
                             folder / "a.slp");
  words.back() = "cam_3=" + (folder / "a.slp");
  const CliRun slp = RunCli(words);
  EXPECT_EQ(slp.exit, 3);
  EXPECT_THAT(slp.err, AllOf(HasSubstr("SLEAP project"), HasSubstr("Export Analysis HDF5")));
  std::filesystem::create_directory(folder / "json");
  words.back() = "cam_3=" + (folder / "json");
  const CliRun mixed = RunCli(words);
  EXPECT_EQ(mixed.exit, 2);
  EXPECT_THAT(mixed.err, HasSubstr("give files of one program for all cameras"));
  const CliRun table = RunCli(
      {"triangulate", "--calib", folder / "calibration.json", "--points2d", folder / "cam_0.csv", "--out", folder / "out"});
  EXPECT_EQ(table.exit, 3);
  EXPECT_THAT(table.err, HasSubstr("give it as --pose2d NAME=FILE"));
  words.back() = "cam_3=" + (folder / "cam_3.csv");
  const CliRun skeleton = RunCli(Join(words, {"--skeleton", "coco17"}));
  EXPECT_EQ(skeleton.exit, 3);
  EXPECT_THAT(skeleton.err, AllOf(HasSubstr("is not in skeleton coco17"), HasSubstr("Nose, LEye")));
  EXPECT_FALSE(std::filesystem::exists(folder / "out/points.csv"));
}

}  // namespace
}  // namespace mvstudio::testing
