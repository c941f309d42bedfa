#include "calib/lens/simpler_lens.h"

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

TEST(NextSimpler, EveryLensComesDownToAnAssumedFocalLengthWithFewerNumbersEachTime) {
  for (const LensModel model : geometry::kAllLensModels) {
    LensStep step{model, {}, false, false};
    if (model == LensModel::kSplined) step.spline = {30, 20};
    int steps = 0;
    while (const auto next = NextSimpler(step)) {
      if (next->model != step.model && step.model != LensModel::kSplined) {
        EXPECT_LT(geometry::NumParams(next->model), geometry::NumParams(step.model)) << geometry::ToString(step.model);
      }
      EXPECT_EQ(geometry::IsWide(next->model), geometry::IsWide(model)) << geometry::ToString(model);
      step = *next;
      ASSERT_LT(++steps, 20);
    }
    EXPECT_TRUE(step.assume_centre && step.assume_focal) << geometry::ToString(model);
  }
}

TEST(PriorOf, StatesItsSigmasInPixels) {
  const geometry::Camera camera = testing::MakeCamera("a", LensModel::kPinhole, 700);
  EXPECT_EQ(PriorOf({LensModel::kPinhole, {}, false, false}, camera, 0.3).mean.size(), 0);
  const LensPrior centre = PriorOf({LensModel::kPinhole, {}, true, false}, camera, 0.3);
  EXPECT_EQ(centre.mean[2], 319.5);
  EXPECT_EQ(centre.mean[3], 239.5);
  EXPECT_EQ(centre.weight[0], 0);
  EXPECT_NEAR(0.3 / std::sqrt(centre.weight[2]), 0.02 * 800, 1e-9);
  const LensPrior focal = PriorOf({LensModel::kPinhole, {}, true, true}, camera, 0.3);
  EXPECT_EQ(focal.mean[0], 576);
  EXPECT_NEAR(0.3 / std::sqrt(focal.weight[0]), 288, 1e-9);
  EXPECT_EQ(ToString({LensModel::kPinhole, {}, true, true}, camera),
            "pinhole, its principal point assumed at the image's centre +- 16 px and its focal length at 576 +- 288 px");
}

CalibrateReport CalibrateFew(int boards, double max_tilt_rad, double noise_px, LensModel truth) {
  testing::SceneOptions options;
  options.num_frames = boards;
  options.max_tilt_rad = max_tilt_rad;
  options.noise_px = noise_px;
  options.model = truth;
  CalibrateOptions calibrate;
  return Calibrate(testing::ToInput(testing::MakeScene(options)), calibrate, {});
}

TEST(SimplerLens, BoardsThatAreParallelToTheImageGiveTheFocalLengthUpAndSaySo) {
  const CalibrateReport report = CalibrateFew(3, 0, 0.3, LensModel::kPinhole);
  if (report.status != Status::kOk) {
    EXPECT_FALSE(report.message.empty());
    return;
  }
  bool told = false;
  for (const CameraReport& camera : report.cameras) told |= !camera.given_up.empty() || camera.assumes;
  EXPECT_TRUE(told) << "three parallel boards do not determine a pinhole";
  EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
}

TEST(SimplerLens, WhatAPinholeSolvesIsSolvedByTheDefault) {
  for (const int boards : {3, 4, 6, 10}) {
    const CalibrateReport report = CalibrateFew(boards, 0.6, 0.2, LensModel::kBrown2);
    EXPECT_EQ(report.status, Status::kOk) << boards << ": " << report.message;
    EXPECT_EQ(report.rig.cameras.size(), 2u);
  }
}

}  // namespace
}  // namespace mvstudio::calib
