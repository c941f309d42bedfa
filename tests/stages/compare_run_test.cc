#include "core/error.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "stages/compare/describe.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

geometry::Rig ThreeCameras() {
  calib::testing::SceneOptions scene;
  scene.num_cameras = 3, scene.num_frames = 2;
  return calib::testing::TruthRig(calib::testing::MakeScene(scene));
}

CompareOptions Written(const TempDir& folder, const geometry::Rig& rig, const geometry::Rig& reference) {
  geometry::WriteRig(rig, folder / "a.json");
  geometry::WriteRig(reference, folder / "b.json");
  CompareOptions options;
  options.rig = folder / "a.json", options.reference = folder / "b.json";
  return options;
}

/// Closed form: the world does not count, and a principal point that moved by (3, 4) px moves far points by 5 px.
TEST(CompareStage, APrincipalPointIsADifferenceAndTheWorldIsNone) {
  const TempDir folder;
  const geometry::Rig reference = ThreeCameras();
  geometry::Rigid3 move;
  move.translation = Eigen::Vector3d(1, -2, 0.5);
  geometry::Rig rig = geometry::InWorld(reference, move);
  for (geometry::RigCamera& camera : rig.cameras) {
    camera.camera.params[2] += 3, camera.camera.params[3] += 4;
  }
  CompareOptions options = Written(folder, rig, reference);
  options.implied = false, options.ranges_m = "inf", options.max_projection_px = 1;
  const CompareReport report = RunCompare(options);
  ASSERT_EQ(report.difference.status, Status::kOk);
  EXPECT_LT(report.difference.max_translation_m, 1e-9);
  ASSERT_EQ(report.lenses.size(), 3u);
  for (const ComparedLenses& lenses : report.lenses) {
    ASSERT_EQ(lenses.diff.ranges.size(), 1u);
    EXPECT_NEAR(lenses.diff.ranges[0].rms_px, 5, 1e-6) << lenses.camera;
  }
  EXPECT_EQ(report.poses.size(), 3u);
  EXPECT_THAT(report.notes.inputs, ElementsAre(options.rig, options.reference));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitQualityGate);
  EXPECT_THAT(said.warnings.back().text, HasSubstr("projection differs by 5 px (rms), allowed 1"));
  EXPECT_NEAR(said.metrics["max_projection_rms_px"].get<double>(), 5, 1e-6);
}

TEST(CompareStage, CamerasOfOneFileAloneAreLeftOutAndNamed) {
  const TempDir folder;
  const geometry::Rig all = ThreeCameras();
  const CompareReport report = RunCompare(Written(folder, geometry::SubsetOf(all, {0, 1}), geometry::SubsetOf(all, {1, 2})));
  EXPECT_THAT(report.only_in_rig, ElementsAre("cam0"));
  EXPECT_THAT(report.only_in_reference, ElementsAre("cam2"));
  EXPECT_THAT(report.cameras, ElementsAre("cam1"));
  EXPECT_THAT(report.poses, IsEmpty());
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitPartial);
  EXPECT_EQ(said.metrics["num_cameras"], 1);
  EXPECT_TRUE(said.metrics["max_rotation_deg"].is_null());
  EXPECT_THAT(said.text, HasSubstr("not comparable: one camera alone is in both"));
}

TEST(CompareStage, RangesThatAreNoDistancesAreRefused) {
  const TempDir folder;
  CompareOptions options = Written(folder, ThreeCameras(), ThreeCameras());
  options.ranges_m = "1,-3";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCompare(options); }), HasSubstr("option 'range-m' 1,-3"));
}

TEST(CompareStage, RigsThatCannotBeAlignedAreAnErrorWithoutFigures) {
  CompareReport report;
  report.difference.status = Status::kDegenerate;
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.errors.at(0).code, "CAL-NOTALIGNED");
  EXPECT_FALSE(said.metrics.contains("projection"));
}

/// Twice what both covariances let expect is said; without a difference there is nothing to say.
TEST(CompareStage, ADifferenceIsSetAgainstWhatCovariancesLetExpect) {
  CompareReport report;
  report.cameras = {"cam0", "cam1"};
  report.poses = {{0.2, 0}, {0, 0.001}}, report.expected_poses = {{0.05, 0.001}, {0.05, 0.001}};
  const CommandResult said = Describe(report);
  EXPECT_NEAR(said.metrics["cameras"][0]["rotation_times"].get<double>(), 4, 1e-12);
  EXPECT_NEAR(said.metrics["cameras"][1]["translation_times"].get<double>(), 1, 1e-12);
  const size_t second = said.text.find("cam1");
  EXPECT_LT(said.text.find("a change"), second);
  EXPECT_EQ(said.text.find("a change", second), std::string::npos);
}

}  // namespace
}  // namespace mvstudio::stages
