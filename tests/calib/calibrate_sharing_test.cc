#include "calib/pipeline/calibrate_steps.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib::internal {
namespace {

constexpr double kNoisePx = 0.2;

struct Shared {
  CalibrateInput input;
  CalibrateOptions options;
  Work work;
  CalibrateReport report;
};

/// Three cameras whose focal lengths grow by `focal_step_px`, adjusted with one lens for all.
Shared AdjustWithOneLens(double focal_step_px, uint64_t seed) {
  testing::SceneOptions scene_options;
  scene_options.num_cameras = 3;
  scene_options.noise_px = kNoisePx;
  scene_options.focal_step_px = focal_step_px;
  scene_options.seed = seed;
  const testing::Scene scene = testing::MakeScene(scene_options);
  Shared made;
  made.input = testing::ToInput(scene);
  made.work.state = scene.truth;
  made.work.state.lens_group = {0, 0, 0};
  for (auto& camera : made.work.state.cameras) camera.params = scene.truth.cameras[0].params;
  std::vector<int64_t> frames = scene.truth.frames;
  made.work.views = MakeViews(made.input.boards, made.input.detections, &frames);
  made.report.cameras.resize(3);
  made.report.cameras[1].shares_lens_with = "cam0";
  EXPECT_EQ(SolveBundle(&made.work.views, &made.work.state, made.work.bundle).status, Status::kOk);
  return made;
}

TEST(SeparateLenses, FocalLengthsOfThreePerCentApartAreFound) {
  Shared made = AdjustWithOneLens(15, 1);
  const auto solved = SeparateLenses(made.input, made.options, &made.work, &made.report);
  ASSERT_TRUE(solved.has_value());
  EXPECT_TRUE(made.work.separated);
  EXPECT_NEAR(solved->sigma_px, kNoisePx, 0.02);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(made.work.state.cameras[c].fx(), 540 + 15.0 * c, 1) << c;
  EXPECT_TRUE(made.report.cameras[1].shares_lens_with.empty());
  EXPECT_NE(made.report.cameras[1].model_reason.find("a lens of its own"), std::string::npos);
}

TEST(SeparateLenses, LensesThatAreOneStayOne) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    Shared made = AdjustWithOneLens(0, seed);
    EXPECT_FALSE(SeparateLenses(made.input, made.options, &made.work, &made.report).has_value()) << seed;
    EXPECT_FALSE(made.work.separated) << seed;
    EXPECT_EQ(made.work.state.lens_group, std::vector<int>({0, 0, 0})) << seed;
    EXPECT_FALSE(made.report.cameras[1].shares_lens_with.empty()) << seed;
  }
}

TEST(SeparateLenses, SharingThatWasAskedForStays) {
  Shared told = AdjustWithOneLens(15, 1), named = told, before = told;
  told.options.share_intrinsics = {LensSharing::Kind::kAll, {}};
  EXPECT_FALSE(SeparateLenses(told.input, told.options, &told.work, &told.report).has_value());
  named.input.same_lens = {{0, 1, 2}};
  EXPECT_FALSE(SeparateLenses(named.input, named.options, &named.work, &named.report).has_value());
  before.work.may_separate = false;
  EXPECT_FALSE(SeparateLenses(before.input, before.options, &before.work, &before.report).has_value());
}

}  // namespace
}  // namespace mvstudio::calib::internal
