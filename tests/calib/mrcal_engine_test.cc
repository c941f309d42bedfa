#include "calib/bundle/mrcal_engine.h"

#include <unistd.h>

#include <cstdio>

#include "core/error.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

/// Views of a scene and a start near the truth.
struct Problem {
  testing::Scene scene;
  RigState state;
  std::vector<View> views;
  MrcalOptions options;
};

Problem MakeProblem(const SceneOptions& scene_options) {
  Problem p;
  p.scene = MakeScene(scene_options);
  p.state = p.scene.truth;
  p.views = MakeViews({p.scene.board}, p.scene.detections, &p.state.frames);
  p.options.boards = {p.scene.board};
  p.options.bundle.reject_outliers = false;
  return p;
}

void Disturb(RigState* state) {
  Rng rng(8);
  const auto random = [&](double size) {
    geometry::Vector6d v;
    for (int i = 0; i < 6; ++i) v[i] = size * rng.Uniform(-1, 1);
    return v;
  };
  for (size_t c = 0; c < state->cameras.size(); ++c) {
    state->cameras[c].params.head<2>() *= 1 + rng.Uniform(-0.02, 0.02);
    if (c > 0) state->cam_from_world[c] = geometry::Perturb(random(0.01), state->cam_from_world[c]);
  }
  for (geometry::Rigid3& pose : state->world_from_board) pose = geometry::Perturb(random(0.01), pose);
}

/// Largest distance, px, between the projections of all corners by two states.
double LargestDifference(const std::vector<View>& views, const RigState& a, const RigState& b) {
  const auto of_a = BundleResiduals(views, a), of_b = BundleResiduals(views, b);
  double largest = 0;
  for (size_t v = 0; v < views.size(); ++v) largest = std::max(largest, (of_a[v] - of_b[v]).colwise().norm().maxCoeff());
  return largest;
}

TEST(SolveWithMrcal, RecoversTheTruthForEveryModelItKnows) {
  for (LensModel model :
       {LensModel::kPinhole, LensModel::kBrown4, LensModel::kBrown5, LensModel::kRational8, LensModel::kThinPrism12}) {
    SceneOptions options;
    options.model = model;
    Problem p = MakeProblem(options);
    Disturb(&p.state);
    const BundleReport report = SolveWithMrcal(&p.views, &p.state, p.options);
    ASSERT_EQ(report.status, Status::kOk) << geometry::ToString(model) << ": " << report.message;
    EXPECT_LT(report.rms_px, 1e-6) << geometry::ToString(model);
    EXPECT_LT(LargestDifference(p.views, p.state, p.scene.truth), 1e-5) << geometry::ToString(model);
  }
}

TEST(SolveWithMrcal, SolvesSplinedLenses) {
  Problem p = MakeProblem({});
  Rng rng(17);
  for (geometry::Camera& camera : p.scene.truth.cameras) {
    camera.model = LensModel::kSplined;
    camera.spline = {3, 8, 6, 80};
    const Eigen::Vector4d core = camera.params.head<4>();
    camera.params = Eigen::VectorXd::Zero(geometry::NumParams(camera));
    camera.params.head<4>() = core;
    for (Eigen::Index i = 4; i < camera.params.size(); ++i) camera.params[i] = 0.004 * rng.Uniform(-1, 1);
  }
  const auto residuals = BundleResiduals(p.views, p.scene.truth);
  for (size_t v = 0; v < p.views.size(); ++v) p.views[v].px += residuals[v];
  p.state = p.scene.truth;
  for (geometry::Camera& camera : p.state.cameras) camera.params.tail(camera.params.size() - 4).setZero();
  const BundleReport report = SolveWithMrcal(&p.views, &p.state, p.options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT(report.rms_px, 1e-2) << "mrcal's prior pulls a little";
  for (const geometry::Camera& camera : p.state.cameras) EXPECT_EQ(camera.params.size(), 4 + 2 * 8 * 6);
}

TEST(SolveWithMrcal, ReachesTheOptimumThatSolveBundleReaches) {
  SceneOptions options;
  options.num_cameras = 3;
  options.noise_px = 0.3;
  for (const Gauge gauge : {Gauge{Gauge::Kind::kCamera, 0}, Gauge{Gauge::Kind::kCamera, 2}, Gauge{Gauge::Kind::kBoard, 4}}) {
    Problem p = MakeProblem(options);
    p.options.bundle.gauge = gauge;
    p.options.bundle.refine_warp = true;
    RigState ours = p.state;
    std::vector<View> views = p.views;
    const BundleReport peer = SolveWithMrcal(&p.views, &p.state, p.options);
    const BundleReport own = SolveBundle(&views, &ours, p.options.bundle);
    ASSERT_EQ(peer.status, Status::kOk) << peer.message;
    ASSERT_EQ(own.status, Status::kOk) << own.message;
    EXPECT_NEAR(peer.rms_px, own.rms_px, 1e-7);
    EXPECT_NEAR(peer.sigma_px, own.sigma_px, 1e-7);
    EXPECT_EQ(peer.num_corners, own.num_corners);
    EXPECT_LT(LargestDifference(views, p.state, ours), 1e-3);
    EXPECT_LT((p.state.board_warp_m[0] - ours.board_warp_m[0]).norm(), 1e-6);
    for (int c = 0; c < 3; ++c) {  // poses themselves: the gauge is the same
      EXPECT_LT((p.state.cam_from_world[c].translation - ours.cam_from_world[c].translation).norm(), 1e-5);
      EXPECT_LT((p.state.cameras[c].params - ours.cameras[c].params).head<4>().norm(), 1e-2);
    }
  }
}

TEST(SolveWithMrcal, FindsTheWarpOfTheBoard) {
  Problem p = MakeProblem({});
  p.scene.truth.board_warp_m[0] = Eigen::Vector2d(1.2e-3, -0.7e-3);
  const auto residuals = BundleResiduals(p.views, p.scene.truth);
  for (size_t v = 0; v < p.views.size(); ++v) p.views[v].px += residuals[v];
  p.options.bundle.refine_warp = true;
  const BundleReport report = SolveWithMrcal(&p.views, &p.state, p.options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT((p.state.board_warp_m[0] - p.scene.truth.board_warp_m[0]).norm(), 1e-9);
}

TEST(SolveWithMrcal, RejectsOutliersAndLeavesOutWhatIsMissing) {
  SceneOptions options;
  options.noise_px = 0.1;
  Problem p = MakeProblem(options);
  int spoiled = 0;
  for (size_t v = 0; v < p.views.size(); v += 3, ++spoiled) p.views[v].px(0, 7) += 25;
  p.views[1].weights.setZero();
  p.views[2].weights[5] = 0;
  p.options.bundle.reject_outliers = true;
  const BundleReport report = SolveWithMrcal(&p.views, &p.state, p.options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.rms_px, 0.1 * std::sqrt(2.0), 0.01);
  EXPECT_NEAR(report.num_rejected, spoiled, 5);
  for (size_t v = 0; v < p.views.size(); v += 3) EXPECT_EQ(p.views[v].weights[7], 0);
  EXPECT_EQ(p.views[1].weights.sum(), 0);
  EXPECT_EQ(p.views[2].weights[5], 0);
}

TEST(SolveWithMrcal, WeightsMeanTheSameAsInSolveBundle) {
  SceneOptions options;
  options.noise_px = 0.2;
  Problem p = MakeProblem(options);
  Rng rng(3);
  for (View& view : p.views) {
    for (double& weight : view.weights) weight = rng.Uniform(0.1, 4);
  }
  RigState ours = p.state;
  std::vector<View> views = p.views;
  ASSERT_EQ(SolveWithMrcal(&p.views, &p.state, p.options).status, Status::kOk);
  ASSERT_EQ(SolveBundle(&views, &ours, p.options.bundle).status, Status::kOk);
  EXPECT_LT(LargestDifference(views, p.state, ours), 1e-3);
}

TEST(SolveWithMrcal, SharesLensesAndKeepsWhatIsFixed) {
  SceneOptions options;
  options.num_cameras = 3;
  options.noise_px = 0.1;
  Problem p = MakeProblem(options);
  p.state.lens_group = {0, 1, 0};
  p.state.cameras[2].params = p.state.cameras[0].params;
  MrcalOptions shared = p.options;
  ASSERT_NE(SolveWithMrcal(&p.views, &p.state, shared).status, Status::kTooFewViews);
  EXPECT_EQ(p.state.cameras[0].params, p.state.cameras[2].params);
  EXPECT_NE(p.state.cameras[0].params, p.state.cameras[1].params);
  Problem fixed = MakeProblem(options);
  fixed.options.bundle.refine_intrinsics = false;
  fixed.options.bundle.refine_cameras = false;
  ASSERT_EQ(SolveWithMrcal(&fixed.views, &fixed.state, fixed.options).status, Status::kOk);
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(fixed.state.cameras[c].params, fixed.scene.truth.cameras[c].params);
    EXPECT_LT((fixed.state.cam_from_world[c].translation - fixed.scene.truth.cam_from_world[c].translation).norm(), 1e-12);
  }
}

TEST(SolveWithMrcal, RefusesWhatMrcalCannotDo) {
  Problem p = MakeProblem({});
  const auto reason = [&] { return WhyNotMrcal(p.views, p.state, p.options); };
  EXPECT_EQ(reason(), "");
  Problem good = p;
  p.state.cameras[1] = testing::MakeCamera("cam1", LensModel::kKannalaBrandt4);
  EXPECT_NE(reason().find("no lens model kannala4"), std::string::npos) << reason();
  EXPECT_THROW(SolveWithMrcal(&p.views, &p.state, p.options), UsageError);
  p.state.cameras[1] = testing::MakeCamera("cam1", LensModel::kBrown5);
  EXPECT_NE(reason().find("cam0 has brown4, cam1 has brown5"), std::string::npos) << reason();
  p = good;
  p.options.bundle.refine_time = true;
  EXPECT_NE(reason().find("time"), std::string::npos);
  p = good;
  p.options.boards[0].kind = Board::Kind::kAprilGrid;
  p.options.boards[0].tag_spacing = 0.3;
  EXPECT_NE(reason().find("grids"), std::string::npos);
  p = good;
  p.options.bundle.fix_camera = {true, false};
  EXPECT_NE(reason(), "");
  p = good;
  p.options.boards.push_back(p.options.boards[0]);
  p.views[3].board = 1;
  EXPECT_NE(reason().find("one board"), std::string::npos);
}

TEST(SolveWithMrcal, BadInputHasAStatus) {
  Problem p = MakeProblem({});
  Problem good = p;
  p.views[0].px(0, 0) = std::nan("");
  EXPECT_EQ(SolveWithMrcal(&p.views, &p.state, p.options).status, Status::kNonFiniteInput);
  p = good;
  for (View& view : p.views) view.weights.setZero();
  EXPECT_EQ(SolveWithMrcal(&p.views, &p.state, p.options).status, Status::kTooFewViews);
  p = good;
  p.state.world_from_board[0].translation.y() -= 100;
  EXPECT_EQ(SolveWithMrcal(&p.views, &p.state, p.options).status, Status::kBehindCamera);
}

TEST(SolveWithMrcal, WritesNothing) {
  SceneOptions options;
  options.noise_px = 0.1;
  Problem p = MakeProblem(options);
  for (size_t v = 0; v < p.views.size(); v += 2) p.views[v].px(0, 3) += 50;  // mrcal reports outliers on standard error
  p.options.bundle.reject_outliers = true;
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  const BundleReport report = SolveWithMrcal(&p.views, &p.state, p.options);
  std::fprintf(stderr, "after");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "after") << "and standard error works again";
  EXPECT_GT(report.num_rejected, 0);
}

}  // namespace
}  // namespace mvstudio::calib
