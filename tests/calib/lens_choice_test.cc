#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "calib/corners/corner_files.h"
#include "calib/lens/lens_beyond.h"
#include "calib/lens/lens_configs.h"
#include "calib/lens/lens_trials.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test_data.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

LensPool PoolOf(LensModel model, const std::vector<View>& views) {
  return MakePool({CalibrateMono(testing::MakeCamera("c0", model), views, BundleOptions(), true)}, {0}, 1);
}

std::vector<View> ViewsOf(LensModel model, int num_frames, double noise_px) {
  testing::SceneOptions options;
  options.num_cameras = 1, options.num_frames = num_frames, options.model = model, options.noise_px = noise_px;
  const auto scene = testing::MakeScene(options);
  std::vector<int64_t> frames;
  return MakeViews({scene.board}, scene.detections, &frames);
}

/// Only the corners within `radius_px` of the image's middle keep a weight.
std::vector<View> InTheMiddle(std::vector<View> views, double radius_px) {
  for (View& view : views) {
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      if ((view.px.col(i) - Eigen::Vector2d(320, 240)).norm() > radius_px) view.weights[i] = 0;
    }
  }
  return views;
}

bool Has(const std::vector<LensCandidate>& candidates, LensModel model) {
  return std::any_of(candidates.begin(), candidates.end(), [&](const LensCandidate& c) { return c.config.model == model; });
}

TEST(TryLenses, HoldsOutThoseAloneThatCanWin) {
  const LensPool pool = PoolOf(LensModel::kBrown4, ViewsOf(LensModel::kBrown4, 14, 0.1));
  SelectionOptions options;
  options.folds = 4;
  const std::vector<LensConfig> all = Configurations(pool, options, false);
  const std::vector<LensCandidate> tried = TryLenses(pool, all, options, BundleOptions(), RunContext());
  EXPECT_TRUE(Has(tried, LensModel::kBrown4));
  EXPECT_FALSE(Has(tried, LensModel::kPinhole)) << "its residuals on its own boards are larger than held-out ones";
  EXPECT_LT(tried.size(), all.size());
  options.models = all;
  EXPECT_EQ(TryLenses(pool, all, options, BundleOptions(), RunContext()).size(), all.size()) << "what was asked for is tried";
}

TEST(PassingLens, TheSimplerLensThatPassesIsTakenWhereHeldOutBoardsDoNotTellThemApart) {
  const LensPool pool = PoolOf(LensModel::kBrown2, InTheMiddle(ViewsOf(LensModel::kBrown2, 14, 0.2), 120));
  std::vector<LensCandidate> candidates;
  for (const LensModel model : {LensModel::kBrown2, LensModel::kThinPrism12})
    candidates.push_back(FitCandidate(pool, {model, {}, false, false}, BundleOptions()));
  candidates[0].relative_error = 1.01, candidates[1].relative_error = 1;
  const BeyondBoards simple = JudgeBeyond(candidates[0].fit, BundleOptions(), 20);
  const BeyondBoards rich = JudgeBeyond(candidates[1].fit, BundleOptions(), 20);
  ASSERT_LT(simple.level, rich.level) << ToString(simple) << " against " << ToString(rich);
  std::string note;
  EXPECT_EQ(PassingLens(candidates, {true, true}, 1, BundleOptions(), 20, &note), 0);
  EXPECT_NE(note.find("thinprism12"), std::string::npos) << note;
  // A lens that is really worse on held-out boards is named and not taken.
  candidates[0].relative_error = 1.5;
  EXPECT_EQ(PassingLens(candidates, {false, true}, 1, BundleOptions(), 20, &note), 1);
  EXPECT_NE(note.find("comes nearest"), std::string::npos) << note;
  EXPECT_NE(note.find("+50.0 %"), std::string::npos) << note;
}

/// Too few boards to hold any out: a rich lens follows their noise, and fails where they were not.
TEST(ChooseLens, OfFewBoardsTheLensPassesWhereOneDoes) {
  for (const double radius_px : {140.0, 170.0}) {
    const LensPool pool = PoolOf(LensModel::kBrown2, InTheMiddle(ViewsOf(LensModel::kBrown2, 4, 0.2), radius_px));
    SelectionOptions options;
    options.need_px = 20;
    const LensChoice choice = ChooseLens(pool, options, BundleOptions(), RunContext());
    ASSERT_GE(choice.index, 0);
    const BeyondBoards taken = JudgeBeyond(choice.candidates[static_cast<size_t>(choice.index)].fit, BundleOptions(), 20);
    const LensCandidate simple = FitCandidate(pool, {LensModel::kBrown2, {}, false, false}, BundleOptions());
    EXPECT_LE(taken.level, JudgeBeyond(simple.fit, BundleOptions(), 20).level) << choice.reason;
  }
}

/// A curve of two parameters claims to know the image where no board was: it stands for no lens of four.
TEST(PassingLens, AShorterCurveOfAnotherWideFamilyDoesNotStandIn) {
  const LensPool pool = PoolOf(LensModel::kKannalaBrandt4, InTheMiddle(ViewsOf(LensModel::kKannalaBrandt4, 14, 0.2), 180));
  std::vector<LensCandidate> candidates;
  for (const LensModel model : {LensModel::kEucm, LensModel::kKannalaBrandt4})
    candidates.push_back(FitCandidate(pool, {model, {}, false, false}, BundleOptions()));
  candidates[0].relative_error = candidates[1].relative_error = 1;
  const double claimed_px = JudgeBeyond(candidates[0].fit, BundleOptions(), 0).side_px;
  const double stated_px = JudgeBeyond(candidates[1].fit, BundleOptions(), 0).side_px;
  ASSERT_LT(claimed_px, stated_px);
  std::string note;
  EXPECT_EQ(PassingLens(candidates, {true, true}, 1, BundleOptions(), std::sqrt(claimed_px * stated_px), &note), 1) << note;
}

TEST(PixelLimits, GrowWithTheImageAndFollowTheNeed) {
  geometry::Camera camera = testing::MakeCamera("c", LensModel::kPinhole);
  double before = 0;
  for (const int scale : {1, 2, 4, 8}) {
    camera.width_px = 320 * scale, camera.height_px = 240 * scale;
    const PixelLimits limits = PixelLimitsOf(camera, 0);
    EXPECT_GE(limits.side_px, std::max(1.0, before));
    EXPECT_GE(limits.fail_side_px, 1.5 * limits.side_px);
    before = limits.side_px;
  }
  EXPECT_EQ(PixelLimitsOf(camera, 0.5).side_px, 0.5);
  EXPECT_EQ(PixelLimitsOf(camera, 0.5).fail_side_px, 2.5);
}

/// A real camera of which the richest lens predicts held-out boards by one percent better than brown5, and misses the image's
/// sides by 30 px.
TEST(ChooseLens, ALensThatMissesTheSidesGivesWay) {
  MVS_NEEDS_DATA("reports/calib/photon-charuco-1280.csv");
  const CornerFile file = ReadCornerFile(mvstudio::testing::DataRoot() + "/reports/calib/photon-charuco-1280.csv", {});
  CalibrateInput input;
  input.boards = file.boards, input.cameras = file.cameras, input.detections = file.detections;
  const CalibrateReport report = Calibrate(input, {}, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NE(report.verdict.outcome(), Outcome::kFail);
  // 0.3 px by independent corners; halves of the recording differ by four times that.
  EXPECT_GE(report.uncertainty.edge_px, 0.8);
  EXPECT_LE(report.uncertainty.edge_px, 1.5) << report.cameras[0].model_reason;
  EXPECT_LE(report.holdout_rms_px, 1.02 * 0.2392) << "no worse than brown5 by itself";
}

}  // namespace
}  // namespace mvstudio::calib
