#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/corners/corner_files.h"
#include "calib/lens/lens_beyond.h"
#include "calib/lens/lens_configs.h"
#include "calib/lens/lens_trials.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"
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

/// Four fisheyes around the boards.
LensPool PoolOfFisheyes() {
  testing::SceneOptions options;
  options.num_cameras = 4, options.num_frames = 14, options.model = LensModel::kKannalaBrandt4, options.noise_px = 0.2;
  const auto scene = testing::MakeScene(options);
  std::vector<int64_t> frames;
  std::vector<std::vector<View>> of_camera(scene.truth.cameras.size());
  for (View& view : MakeViews({scene.board}, scene.detections, &frames)) {
    const auto c = static_cast<size_t>(std::exchange(view.camera_idx, 0));
    of_camera[c].push_back(view);
  }
  std::vector<MonoSolution> monos;
  for (size_t c = 0; c < of_camera.size(); ++c)
    monos.push_back(CalibrateMono(scene.truth.cameras[c], of_camera[c], BundleOptions(), true));
  return MakePool(monos, {0, 1, 2, 3}, 1);
}

/// What is tried of fisheyes with a lens at the noise: no curve of another family, and no grid.
TEST(TryLenses, NoOtherFamilyIsTriedWhereKannala4IsAtTheNoise) {
  const LensPool pool = PoolOfFisheyes();
  std::vector<LensConfig> configs;
  for (const LensModel model : {LensModel::kUcm, LensModel::kEucm, LensModel::kDoubleSphere, LensModel::kKannalaBrandt4,
                                LensModel::kEucmP, LensModel::kKannalaBrandt4P})
    configs.push_back({model, {}, false, false});
  configs.push_back({LensModel::kSplined, {3, 8, 6, 100}, false, false});
  SelectionOptions options;
  options.folds = 3;
  for (const LensCandidate& tried : TryLenses(pool, configs, options, BundleOptions(), RunContext())) {
    const LensModel model = tried.config.model;
    EXPECT_TRUE(model == LensModel::kKannalaBrandt4 || model == LensModel::kKannalaBrandt4P) << ToString(tried.config);
  }
  const std::vector<LensConfig> curves = {{LensModel::kUcm, {}, false, false}, {LensModel::kEucm, {}, false, false}};
  EXPECT_FALSE(TryLenses(pool, curves, options, BundleOptions(), RunContext()).empty()) << "by themselves they are tried";
}

TEST(Configurations, HaveNoMoreThanFourTermsOrThePlacesOfTheBoard) {
  for (const int num_frames : {4, 6, 9, 16}) {
    const LensPool pool = PoolOf(LensModel::kBrown2, ViewsOf(LensModel::kBrown2, num_frames, 0.1));
    const int places = ClustersOfCameras(pool)[0];
    ASSERT_LE(places, num_frames);
    int most = 0;
    for (const LensConfig& config : Configurations(pool, {}, false))
      most = std::max(most, geometry::NumDistortionParams(config.model));
    EXPECT_EQ(most, places >= 12 ? 12 : places >= 8 ? 8 : places >= 5 ? 5 : 4) << places << " places";
  }
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
  // Where neither passes, the one that misses by less is named.
  note.clear();
  EXPECT_EQ(PassingLens(candidates, {true, true}, 1, BundleOptions(), 1e-3, &note), 1);
  EXPECT_NE(note.find("comes nearest"), std::string::npos) << note;
  EXPECT_NE(note.find("+1.0 %"), std::string::npos) << note;
  // A lens that is really worse on held-out boards is neither taken nor advised.
  note.clear();
  candidates[0].relative_error = 1.5;
  EXPECT_EQ(PassingLens(candidates, {false, true}, 1, BundleOptions(), 20, &note), 1);
  EXPECT_EQ(note, "");
}

/// A webcam's lens of twelve terms that folded in 27 % of the image was taken where pinholes were as good, and as uncertain.
TEST(IsSafer, OfTwoThatWarnTheOneThatIsSound) {
  using Level = BeyondBoards::Level;
  const BeyondBoards sound{Level::kWarn, 2.5, 0, true}, folded{Level::kWarn, 2.5, 0.27, true},
      decentred{Level::kWarn, 2.5, 0, false};
  for (const BeyondBoards& bad : {folded, decentred}) {
    EXPECT_TRUE(IsSafer(sound, bad)) << ToString(bad);
    EXPECT_FALSE(IsSafer(bad, sound)) << ToString(bad);
    EXPECT_FALSE(IsSafer(bad, bad));
  }
  EXPECT_FALSE(IsSafer(sound, sound));
  EXPECT_TRUE(IsSafer({Level::kPass, 1, 0, true}, sound));
  EXPECT_FALSE(IsSafer(sound, {Level::kPass, 1, 0, true}));
  // Where both fail, neither is to be used, and the richer one stays with its advice.
  EXPECT_FALSE(IsSafer({Level::kFail, 90, 0, true}, {Level::kFail, 90, 0.27, true}));
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

LensCandidate CandidateOf(const geometry::Camera& camera, double relative_error) {
  LensCandidate candidate;
  candidate.fit.state.cameras = {camera};
  candidate.relative_error = relative_error;
  return candidate;
}

/// A lens that folds in more than a tenth of the image, or is decentred as none is, must be better by 10 %, others by 2 %.
TEST(NearTheBest, AskMoreOfALensThatIsSpoiled) {
  const auto near_of = [](const geometry::Camera& chosen) {
    std::vector<double> errors;
    for (const double error : {1.015, 1.05, 1.09, 1.12}) {
      const auto near =
          NearTheBest({CandidateOf(testing::MakeCamera("c0", LensModel::kPinhole), error), CandidateOf(chosen, 1)}, 1);
      EXPECT_TRUE(near[1]);
      if (near[0]) errors.push_back(error);
    }
    return errors;
  };
  const std::vector<double> sound = {1.015}, spoiled = {1.015, 1.05, 1.09};
  geometry::Camera folds = testing::MakeCamera("c0", LensModel::kBrown4);
  folds.params.tail(4).setZero();
  EXPECT_EQ(near_of(folds), sound);
  double below = 0, above = 0;  // shares of the image on either side of the tenth
  for (double k1 = 0; above == 0 && k1 > -10; k1 -= 0.01) {
    folds.params[4] = k1;
    const double share = FindFolds(folds).share;
    if (share > 0.1) above = share;
    if (share > 0.05 && share <= 0.1) below = share;
    if (share > 0.05) {
      EXPECT_EQ(near_of(folds), share > 0.1 ? spoiled : sound) << share;
    }
  }
  EXPECT_GT(below, 0.05);
  EXPECT_GT(above, 0.1);
  geometry::Camera decentred = testing::MakeCamera("c0", LensModel::kBrown4);
  decentred.params.tail(4) << 0, 0, 0.08, 0;
  EXPECT_EQ(near_of(decentred), spoiled);
}

}  // namespace
}  // namespace mvstudio::calib
