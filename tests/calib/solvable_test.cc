#include "calib/pipeline/solvable.h"

#include <algorithm>

#include "calib/pipeline/calibrate_steps.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

testing::Scene FourCameras() {
  testing::SceneOptions options;
  options.num_cameras = 4, options.num_frames = 12, options.noise_px = 0.1, options.model = geometry::LensModel::kBrown2;
  return testing::MakeScene(options);
}

CalibrateOptions Quick() {
  CalibrateOptions options = testing::PlainOptions();
  options.motions = false;
  return options;
}

void ExpectOthers(const SolvableCalibration& found, const testing::Scene& scene) {
  ASSERT_EQ(found.report.status, Status::kOk) << found.report.message;
  EXPECT_THAT(found.kept, ElementsAre(0, 1, 3));
  ASSERT_EQ(found.left_out.size(), 1u);
  EXPECT_EQ(found.left_out[0].name, "cam2");
  geometry::Rig truth = testing::TruthRig(scene);
  truth.cameras.erase(truth.cameras.begin() + 2);
  EXPECT_LT(geometry::CompareRigs(found.report.rig, truth).max_translation_m, 0.01);
}

TEST(CalibrateSolvable, WithoutFaultsIsCalibrate) {
  const testing::Scene scene = FourCameras();
  const SolvableCalibration found = CalibrateSolvable(testing::ToInput(scene), Quick(), {});
  EXPECT_EQ(found.report.status, Status::kOk);
  EXPECT_THAT(found.left_out, IsEmpty());
  EXPECT_THAT(found.kept, ElementsAre(0, 1, 2, 3));
}

TEST(CalibrateSolvable, ACameraWithoutCornersIsLeftOut) {
  const testing::Scene scene = FourCameras();
  CalibrateInput input = testing::ToInput(scene);
  input.detections.erase(
      std::remove_if(input.detections.begin(), input.detections.end(), [](const Detection& d) { return d.camera_idx == 2; }),
      input.detections.end());
  ExpectOthers(CalibrateSolvable(input, Quick(), {}), scene);
}

TEST(CalibrateSolvable, ACameraWithoutALinkIsLeftOut) {
  const testing::Scene scene = FourCameras();
  CalibrateInput input = testing::ToInput(scene);
  for (Detection& d : input.detections) d.frame_idx += d.camera_idx == 2 ? 1000 : 0;
  const SolvableCalibration found = CalibrateSolvable(input, Quick(), {});
  ExpectOthers(found, scene);
  EXPECT_FALSE(found.left_out[0].reason.empty());
}

/// Corners that no lens and no pose can explain.
TEST(CalibrateSolvable, ACameraOfNonsenseIsLeftOut) {
  const testing::Scene scene = FourCameras();
  CalibrateInput input = testing::ToInput(scene);
  for (Detection& d : input.detections) {
    if (d.camera_idx == 2) d.points_px.colwise() = Eigen::Vector2d(100, 100);
  }
  ExpectOthers(CalibrateSolvable(input, Quick(), {}), scene);
}

TEST(CalibrateSolvable, WhatNobodyCanSolveStaysAFailure) {
  const testing::Scene scene = FourCameras();
  CalibrateInput input = testing::ToInput(scene);
  for (Detection& d : input.detections) d.frame_idx += 1000 * d.camera_idx;  // nobody sees a board with another
  const SolvableCalibration found = CalibrateSolvable(input, Quick(), {});
  EXPECT_NE(found.report.status, Status::kOk);
  EXPECT_THAT(found.left_out, IsEmpty());
  EXPECT_EQ(found.kept.size(), 4u);
}

TEST(CalibrateSolvable, ACameraThatAnOptionNamesIsNotLeftOut) {
  const testing::Scene scene = FourCameras();
  CalibrateInput input = testing::ToInput(scene);
  for (Detection& d : input.detections) d.frame_idx += d.camera_idx == 2 ? 1000 : 0;
  CalibrateOptions options = Quick();
  options.world.camera = "cam2";
  const SolvableCalibration found = CalibrateSolvable(input, options, {});
  EXPECT_NE(found.report.status, Status::kOk);
  EXPECT_THAT(found.left_out, IsEmpty());
}

TEST(NameLeftOut, TheVerdictSaysWhoIsMissing) {
  Verdict verdict;
  NameLeftOut({}, &verdict);
  EXPECT_EQ(verdict.outcome(), Outcome::kPass);
  NameLeftOut({{"cam2", "no corners"}, {"cam3", "no link"}}, &verdict);
  EXPECT_EQ(verdict.outcome(), Outcome::kWarn);
  ASSERT_EQ(verdict.reasons.size(), 1u);
  EXPECT_EQ(verdict.reasons[0].code, "CAL-LEFTOUT");
  EXPECT_EQ(verdict.reasons[0].text, "cameras cam2, cam3 are left out: the verdict is of the others");
  verdict = {{{"CAL-VOLUME", "x", "", true}}};
  NameLeftOut({{"cam2", "no corners"}}, &verdict);
  EXPECT_EQ(verdict.outcome(), Outcome::kFail) << "a gate that failed counts more";
  EXPECT_EQ(verdict.reasons[0].text, "camera cam2 is left out: the verdict is of the others");
}

TEST(CamerasBesideMost, NeedAMajority) {
  EXPECT_THAT(internal::CamerasBesideMost({{0, 1, 3}, {2}}), ElementsAre(2));
  EXPECT_THAT(internal::CamerasBesideMost({{2}, {0, 1, 3}}), ElementsAre(2));
  EXPECT_THAT(internal::CamerasBesideMost({{0, 1}, {2, 3}}), IsEmpty());
  EXPECT_THAT(internal::CamerasBesideMost({{0}, {1}, {2, 3}}), IsEmpty());
  EXPECT_THAT(internal::CamerasBesideMost({}), IsEmpty());
}

TEST(InputOf, RenumbersCamerasAndGroups) {
  CalibrateInput input;
  input.cameras = {{"a", 1, 1}, {"b", 1, 1}, {"c", 1, 1}};
  Detection d;
  d.camera_idx = 2;
  input.detections = {d, Detection()};
  input.same_lens = {{0, 1}, {1, 2}};
  const CalibrateInput part = InputOf(input, {1, 2});
  EXPECT_EQ(part.cameras[0].name, "b");
  ASSERT_EQ(part.detections.size(), 1u);
  EXPECT_EQ(part.detections[0].camera_idx, 1);
  EXPECT_THAT(part.same_lens, ElementsAre(ElementsAre(0, 1)));
}

}  // namespace
}  // namespace mvstudio::calib
