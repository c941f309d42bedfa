#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig_io.h"
#include "stages/tradeoff/predictions.h"
#include "stages/triangulate/describe.h"
#include "stages/triangulate/run.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/triangulate/support.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const char* const kMouseJoints[] = {"nose", "neck", "tail"};

Eigen::Vector3d MouseJointAt(int joint, int frame) {
  return {0.3 * std::cos(0.2 * frame + joint), 0.3 * std::sin(0.3 * frame - joint), 0.2 * joint - 0.2};
}

/// A table of three joints in `num_frames` frames of four cameras; `late`: frames by which the last one is.
TriangulateOptions TakeToSolve(const TempDir& folder, int num_frames = 40, int late = 0) {
  const geometry::Rig rig = triangulate::MakeRing(4);
  geometry::WriteRig(rig, folder / "calibration.json");
  std::string table = "camera,frame,person,joint,x_px,y_px,score\n";
  Rng rng(3);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    for (int f = 0; f < num_frames; ++f) {
      for (int j = 0; j < 3; ++j) {
        const Eigen::Vector3d x = MouseJointAt(j, f - (c == 3 ? late : 0));
        const auto at = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x);
        table += rig.cameras[c].camera.name + "," + std::to_string(f) + ",0," + kMouseJoints[j] + "," +
                 std::to_string(at.px.x() + 0.5 * rng.Normal()) + "," + std::to_string(at.px.y() + 0.5 * rng.Normal()) +
                 ",0.9\n";
      }
    }
  }
  WriteFileAtomic(folder / "points2d.csv", table);
  TriangulateOptions options;
  options.pose.calib = folder / "calibration.json", options.pose.points2d = folder / "points2d.csv";
  options.out = folder / "out";
  return options;
}

TEST(TriangulateStage, PointsAreThoseThatWereFilmed) {
  const TempDir folder;
  const TriangulateReport report = RunTriangulate(TakeToSolve(folder));
  EXPECT_EQ(report.points.num_points, 120);
  EXPECT_EQ(report.loss.kind, Loss::Kind::kNone);
  EXPECT_EQ(report.inconsistency, Inconsistency::kNone);
  EXPECT_THAT(report.cameras, ElementsAre("cam_0", "cam_1", "cam_2", "cam_3"));
  ASSERT_EQ(report.take.points.size(), 120u);
  for (const triangulate::TakePoint& at : report.take.points)
    EXPECT_LT((at.point.x_in_world - MouseJointAt(at.joint_idx, at.frame)).norm(), 0.01) << at.frame;
  const dataset::Pose3d kept = dataset::ReadPose3d(folder / "out");
  EXPECT_EQ(kept.rows.size(), 120u);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_EQ(said.folder, folder / "out");
  EXPECT_EQ(said.metrics["num_points"], 120);
  EXPECT_THAT(said.errors, IsEmpty());
  EXPECT_THAT(said.text, HasSubstr("120 of 120 joints triangulated"));
  EXPECT_THAT(said.inputs, ElementsAre(folder / "calibration.json", folder / "points2d.csv"));
}

TEST(TriangulateStage, InPartsTheCountsAreTheSame) {
  const TempDir folder;
  TriangulateOptions options = TakeToSolve(folder);
  options.chunk_frames = 16;
  EXPECT_EQ(RunTriangulate(options).points.num_points, 120);
  options.refine = true;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunTriangulate(options); }), HasSubstr("leave option 'chunk-frames' out"));
}

TEST(TriangulateStage, ALateCameraIsAskedAbout) {
  const TempDir folder;
  const TriangulateReport report = RunTriangulate(TakeToSolve(folder, 120, 6));
  EXPECT_NE(report.asked, CauseQuestion::kNone);
  EXPECT_FALSE(Describe(report).warnings.empty() && Describe(report).errors.empty());
}

TEST(TriangulateStage, WithoutFramesInCommonTheReasonIsKnownAndOlderPointsStay) {
  const TempDir folder;
  TriangulateOptions options = TakeToSolve(folder);
  RunTriangulate(options);
  options.points.min_score = 0.95;
  const std::string before = ReadFile(folder / "out/points.csv");
  const TriangulateReport report = RunTriangulate(options);
  EXPECT_EQ(report.loss.kind, Loss::Kind::kAll);
  EXPECT_EQ(report.loss.reason, Loss::Reason::kScores);
  EXPECT_EQ(report.asked, CauseQuestion::kNone);
  EXPECT_TRUE(report.kept_older);
  EXPECT_EQ(ReadFile(folder / "out/points.csv"), before);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.folder, "");
  ASSERT_EQ(said.errors.size(), 1u);
  EXPECT_THAT(said.errors[0].text, HasSubstr("have a score below option 'min-score' 0.95"));
}

TEST(TriangulateStage, WhyThereIsNoCovarianceIsAFact) {
  TriangulateReport report;
  EXPECT_EQ(report.WhyWithoutCovariance(), "");
  report.options.points.ignore_distortion = true;
  EXPECT_THAT(report.WhyWithoutCovariance(), HasSubstr("option 'ignore-distortion'"));
  report.options.points.calibration_covariance = false;
  EXPECT_EQ(report.WhyWithoutCovariance(), "option 'calibration-covariance' is off");
}

TEST(TriangulateStage, OptionsThatWereChosenAreNotTheProjectsToSet) {
  ProjectInput project;
  project.settings.min_score = 0.7, project.settings.min_views = 3, project.settings.fill_frames = 4;
  TriangulateOptions options;
  InputNotes notes;
  const ProjectUse use = UseProject(project, {"min-score"}, &options.points, &options.markers, &notes);
  EXPECT_EQ(options.points.min_score, 0.3);
  EXPECT_EQ(options.points.min_views, 3);
  ASSERT_EQ(use.settings.size(), 1u);
  EXPECT_EQ(use.settings[0], std::pair(std::string("min-views"), std::string("3")));
  ASSERT_EQ(notes.warnings.size(), 1u) << "gaps are filled by time, and no frame rate is known";
  EXPECT_EQ(notes.warnings[0].code, "POSE-PROJECT");
}

/// What a budget chose gives the files of the same flags given by hand, and is kept beside its prediction.
TEST(TriangulateStage, ABudgetChoosesWhatCanBeRepeatedByHand) {
  const TempDir folder;
  TriangulateOptions options = TakeToSolve(folder, 80);
  double clock_s = 0;
  options.budget.budget = "1h", options.budget.now_s = [&] { return clock_s += 1; };
  options.given = {"holdout-points"};
  const TriangulateReport report = RunTriangulate(options);
  ASSERT_TRUE(report.budget);
  ASSERT_EQ(report.budget->trials.size(), 3u) << "the setting with other points left out is no longer free";
  EXPECT_TRUE(std::isfinite(report.budget->actual_error));
  const SettingTrial& chosen = report.budget->Chosen();
  EXPECT_NEAR(chosen.error, report.budget->actual_error, 0.5 * chosen.error);
  const nlohmann::ordered_json said = Describe(report).metrics["budget"];
  EXPECT_GT(said["predicted_seconds"], 0);
  EXPECT_GE(said["reasons"].size(), 2u);

  TriangulateOptions by_hand = TakeToSolve(folder, 80);
  by_hand.out = folder / "by_hand";
  const auto& flags = chosen.flags;
  by_hand.refine = !flags.empty();
  if (flags.size() == 3) by_hand.refinement.choice_frames = 60, by_hand.refinement.choice_cameras = 3;
  RunTriangulate(by_hand);
  for (const char* name : {"/points.csv", "/covariance.csv", "/pose3d.json"})
    EXPECT_EQ(ReadFile(options.out + name), ReadFile(by_hand.out + name)) << name;

  PredictionsOptions kept;
  kept.files = {folder / "out"}, kept.out = folder / "page";
  const PredictionsReport predictions = RunPredictions(kept);
  ASSERT_EQ(predictions.predictions.size(), 1u);
  EXPECT_EQ(predictions.predictions[0].stage, "triangulate");
  EXPECT_EQ(predictions.predictions[0].frames, 80);
  EXPECT_DOUBLE_EQ(predictions.predictions[0].predicted_s, chosen.predicted_s);
  EXPECT_THAT(ReadFile(predictions.page), HasSubstr("<svg"));
}

TEST(TriangulateStage, ATargetOutOfReachIsSaid) {
  const TempDir folder;
  TriangulateOptions options = TakeToSolve(folder);
  options.budget.target = "0.001px";
  const CommandResult said = Describe(RunTriangulate(options));
  ASSERT_FALSE(said.warnings.empty());
  EXPECT_EQ(said.warnings[0].code, "BUD-TARGET");
  EXPECT_EQ(said.exit, kExitOk);
  options.budget.budget = "1ms";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunTriangulate(options); }), HasSubstr("is predicted to take"));
  options.budget.budget = "soon";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunTriangulate(options); }), HasSubstr("option 'budget' 'soon'"));
}

}  // namespace
}  // namespace mvstudio::stages
