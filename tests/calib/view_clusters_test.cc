#include "calib/bundle/view_clusters.h"

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Views of boards of which each stands still for `repeats` frames; the noise of repeated images is partly the same.
struct Held {
  testing::Scene scene;
  std::vector<View> views;
  std::vector<int64_t> frames;
};

Held HoldStill(int places, int repeats, double common_px, double own_px) {
  testing::SceneOptions options;
  options.num_frames = places;
  Held held{testing::MakeScene(options), {}, {}};
  std::vector<Detection> repeated;
  Rng rng(3);
  for (Detection detection : held.scene.detections) {
    for (double& x : detection.points_px.reshaped()) x += common_px * rng.Normal();
    for (int k = 0; k < repeats; ++k) {
      Detection copy = detection;
      copy.frame_idx = detection.frame_idx * 1000 + k;
      for (double& x : copy.points_px.reshaped()) x += own_px * rng.Normal();
      repeated.push_back(copy);
    }
  }
  held.views = MakeViews({held.scene.board}, repeated, &held.frames);
  return held;
}

/// Errors of the corners: what was added to the exact projections.
std::vector<Eigen::Matrix2Xd> Errors(const Held& held) {
  std::vector<Eigen::Matrix2Xd> errors;
  for (const View& view : held.views) {
    const int place = static_cast<int>(held.frames[view.frame] / 1000 - 1) / 3;
    const auto& truth = held.scene.truth;
    errors.push_back(*ResidualsOf(view, truth.cameras[view.camera_idx],
                                  truth.cam_from_world[view.camera_idx] * truth.world_from_board[place]));
  }
  return errors;
}

TEST(ClusterViews, BoardsThatStandStillAreOneBoardsThatMoveAreMany) {
  const Held held = HoldStill(12, 8, 0.3, 0.3);
  const std::vector<int> of_view = ClusterViews(held.views);
  EXPECT_EQ(CountClusters(of_view), static_cast<int>(held.scene.detections.size()));
  const std::vector<int> of_frame = ClusterFrames(held.views, of_view, held.frames.size());
  EXPECT_EQ(CountClusters(of_frame), 12);
  for (size_t f = 0; f < of_frame.size(); ++f) EXPECT_EQ(of_frame[f], of_frame[f / 8 * 8]);
}

TEST(ClusterViews, ABoardThatReturnsJoinsWhereItWas) {
  Held held = HoldStill(3, 2, 0, 0.1);
  for (View& view : held.views) view.frame = (view.frame % 2) * 3 + view.frame / 2;  // places 0 1 2 0 1 2
  EXPECT_EQ(CountClusters(ClusterViews(held.views)), static_cast<int>(held.scene.detections.size()));
}

TEST(ClusterViews, NothingInCommonIsNotTheSamePlace) {
  Held held = HoldStill(1, 2, 0, 0);
  ASSERT_GE(held.views.size(), 2u);
  for (int& id : held.views[0].corner_ids) id += 1000;
  EXPECT_EQ(CountClusters(ClusterViews({held.views[0], held.views[1]})), 2);
  EXPECT_TRUE(ClusterViews({}).empty());
}

TEST(ClusterFrames, FramesThatNobodySeesHaveNone) {
  Held held = HoldStill(2, 1, 0, 0);
  for (View& view : held.views) view.weights *= view.frame == 0;
  EXPECT_EQ(ClusterFrames(held.views, ClusterViews(held.views), held.frames.size()), (std::vector<int>{0, -1}));
}

TEST(RepeatCorrelation, IsTheShareOfTheVarianceThatRepeats) {
  for (const auto& [common, own] : {std::pair{0.0, 0.3}, {0.3, 0.3}, {0.3, 0.1}, {0.3, 1e-9}}) {
    const Held held = HoldStill(12, 8, common, own);
    const std::vector<int> of_frame = ClusterFrames(held.views, ClusterViews(held.views), held.frames.size());
    const std::vector<double> found = RepeatCorrelation(held.views, of_frame, Errors(held), 2);
    for (const double correlation : found)
      EXPECT_NEAR(correlation, common * common / (common * common + own * own), 0.06) << common << " " << own;
  }
}

TEST(RepeatCorrelation, WithoutRepeatsThereIsNone) {
  const Held held = HoldStill(6, 1, 0, 0.3);
  EXPECT_EQ(
      RepeatCorrelation(held.views, ClusterFrames(held.views, ClusterViews(held.views), held.frames.size()), Errors(held), 2),
      (std::vector<double>{0, 0}));
}

TEST(DiscountRepeats, RepeatsThatAreCopiesCountOnceOthersInFull) {
  const Held held = HoldStill(4, 5, 0, 0.1);
  const std::vector<int> of_frame = ClusterFrames(held.views, ClusterViews(held.views), held.frames.size());
  const auto total = [](const std::vector<View>& views, int camera) {
    double sum = 0;
    for (const View& view : views) sum += view.camera_idx == camera ? view.weights.sum() : 0;
    return sum;
  };
  const std::vector<View> discounted = DiscountRepeats(held.views, of_frame, {1, 0});
  EXPECT_NEAR(total(discounted, 0), total(held.views, 0) / 5, 1e-9);
  EXPECT_EQ(total(discounted, 1), total(held.views, 1));
}

}  // namespace
}  // namespace mvstudio::calib
