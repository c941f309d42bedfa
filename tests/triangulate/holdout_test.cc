#include "triangulate/point/holdout.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <atomic>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "core/error.h"
#include "tests/triangulate/support.h"

namespace mvstudio::triangulate {
namespace {

struct Scene {
  geometry::Rig rig;
  PreparedRig prepared;
  std::vector<std::vector<Observation>> points;
  std::vector<PointLabel> labels;
  std::vector<Eigen::Vector3d> truth;
};

/// `num_frames` frames of 10 random points with 1 px noise; a fraction of the detections lies anywhere within 200 px.
Scene MakeScene(int num_cameras, int num_frames, double noise_px, double outliers, uint64_t seed) {
  Scene scene;
  scene.rig = MakeRing(num_cameras);
  scene.prepared = Prepare(scene.rig);
  Rng rng(seed);
  for (int f = 0; f < num_frames; ++f) {
    for (int j = 0; j < 10; ++j) {
      scene.truth.push_back(RandomPoint(&rng));
      scene.points.push_back(Observe(scene.rig, scene.truth.back(), noise_px, &rng));
      for (Observation& seen : scene.points.back()) {
        if (rng.Uniform() < outliers) seen.px += Eigen::Vector2d(rng.Uniform(-200, 200), rng.Uniform(-200, 200));
      }
      scene.labels.push_back({f, 0, j});
    }
  }
  return scene;
}

PointSolver SolverOf(const PreparedRig& rig, PointMethod method = PointMethod::kRobust) {
  return [&rig, method](const std::vector<Observation>& observations) {
    PointOptions options;
    options.method = method;
    return TriangulatePoint(rig, observations, options);
  };
}

TEST(LeaveOneCameraOut, PredictsExactDetectionsExactly) {
  const Scene scene = MakeScene(5, 4, 0, 0, 1);
  const auto samples = LeaveOneCameraOut(scene.prepared, scene.points, SolverOf(scene.prepared), 1);
  size_t detections = 0;
  for (const auto& each : scene.points) detections += each.size();
  ASSERT_EQ(samples.size(), detections);
  for (const LeftOutSample& sample : samples) {
    ASSERT_EQ(sample.status, Status::kOk);
    EXPECT_LT(sample.residual_px.norm(), 1e-8);
  }
}

TEST(LeaveOneCameraOut, VeryManyCamerasTakeTurns) {
  const Scene scene = MakeScene(130, 2, 0.1, 0, 9);
  std::atomic<int> solved = 0;
  const auto count = [&](const std::vector<Observation>& others) {
    ++solved;
    return SolverOf(scene.prepared, PointMethod::kLinear)(others);
  };
  const auto samples = LeaveOneCameraOut(scene.prepared, scene.points, count, 1);
  EXPECT_LE(solved, 32 * static_cast<int>(scene.points.size()));
  EXPECT_GE(solved, 20 * static_cast<int>(scene.points.size()));
  std::set<int> cameras;
  std::set<std::pair<int, int>> pairs;  // a joint meets other cameras in the next frame
  for (const LeftOutSample& sample : samples) {
    cameras.insert(sample.camera_idx);
    pairs.insert({sample.camera_idx, scene.labels[sample.point].joint_idx});
  }
  EXPECT_EQ(cameras.size(), 130u);
  EXPECT_GT(pairs.size(), samples.size() / 2);
}

TEST(LeaveOneCameraOut, ResidualIsDetectionMinusProjection) {
  Scene scene = MakeScene(4, 1, 0, 0, 2);
  scene.points[3][1].px += Eigen::Vector2d(3, -2);
  const auto samples = LeaveOneCameraOut(scene.prepared, {scene.points[3]}, SolverOf(scene.prepared), 1);
  EXPECT_NEAR((samples[1].residual_px - Eigen::Vector2d(3, -2)).norm(), 0, 1e-8);
}

TEST(LeaveOneCameraOut, PredictedCovarianceCoversTheResiduals) {
  const Scene scene = MakeScene(4, 200, 1.0, 0, 3);
  const auto samples = LeaveOneCameraOut(scene.prepared, scene.points, SolverOf(scene.prepared, PointMethod::kAllViews), 2);
  int inside68 = 0, inside95 = 0, count = 0;
  size_t last = std::numeric_limits<size_t>::max();
  for (const LeftOutSample& sample : samples) {
    if (sample.point == last) continue;  // one a point: those of one point are not independent
    last = sample.point;
    ASSERT_EQ(sample.status, Status::kOk);
    const double d2 = sample.residual_px.dot(sample.covariance_px2.inverse() * sample.residual_px);
    inside68 += d2 < -2 * std::log(1 - 0.68), inside95 += d2 < -2 * std::log(1 - 0.95), ++count;
  }
  ASSERT_EQ(count, 2000);
  EXPECT_NEAR(inside68 / 2000.0, 0.68, 4 * std::sqrt(0.68 * 0.32 / 2000));
  EXPECT_NEAR(inside95 / 2000.0, 0.95, 4 * std::sqrt(0.95 * 0.05 / 2000));
  const LeftOutSummary summary = SummarizeLeftOut(scene.prepared, samples, scene.labels);
  EXPECT_NEAR(summary.all.median_sigmas, std::sqrt(2 * std::log(2.0)), 0.05);
  EXPECT_EQ(summary.all.coverage, 1);
  EXPECT_EQ(summary.cameras.size(), 4u);
  EXPECT_EQ(summary.joints.size(), 10u);
}

TEST(LeaveOneCameraOut, CopiesOfACameraDoNotPredictIt) {
  Scene scene = MakeScene(3, 1, 0, 0, 4);
  scene.rig.cameras.push_back(scene.rig.cameras[0]);
  scene.rig.cameras.back().camera.name = "copy";
  const PreparedRig rig = Prepare(scene.rig);
  std::vector<Observation> seen = scene.points[0];
  seen.push_back({3, seen[0].px, 1, 1});
  const auto samples = LeaveOneCameraOut(
      rig, {seen},
      [](const std::vector<Observation>& others) {
        for (const Observation& other : others) EXPECT_TRUE(others.size() > 2 || other.camera_idx % 3 != 0);
        return Point{};
      },
      1);
  EXPECT_EQ(samples.size(), 4u);
}

TEST(LeaveOneCameraOut, TwoViewsPredictNothing) {
  const Scene scene = MakeScene(2, 2, 1, 0, 5);
  EXPECT_TRUE(LeaveOneCameraOut(scene.prepared, scene.points, SolverOf(scene.prepared), 1).empty());
  const MethodChoice choice = ChooseMethod(
      scene.prepared, scene.points, scene.labels,
      {{"safe", 2, SolverOf(scene.prepared)}, {"cheap", 1, SolverOf(scene.prepared, PointMethod::kMidpoint)}}, {}, 1);
  EXPECT_EQ(choice.status, Status::kTooFewViews);
  EXPECT_EQ(choice.chosen, 0u);
}

TEST(LeaveOneCameraOut, DoesNotDependOnThreads) {
  const Scene scene = MakeScene(5, 30, 1, 0.2, 6);
  const auto one = LeaveOneCameraOut(scene.prepared, scene.points, SolverOf(scene.prepared), 1);
  const auto three = LeaveOneCameraOut(scene.prepared, scene.points, SolverOf(scene.prepared), 3);
  ASSERT_EQ(one.size(), three.size());
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].residual_px, three[i].residual_px);
}

/// One sample of each given error; NaN: refused.
std::vector<LeftOutSample> Samples(const std::vector<double>& errors) {
  std::vector<LeftOutSample> samples;
  for (size_t i = 0; i < errors.size(); ++i) {
    LeftOutSample sample;
    sample.point = i;
    sample.status = std::isnan(errors[i]) ? Status::kLowParallax : Status::kOk;
    sample.residual_px = {errors[i], 0};
    sample.covariance_px2.setIdentity();
    samples.push_back(sample);
  }
  return samples;
}

TEST(SummarizeLeftOut, RefusedSamplesRankLast) {
  const PreparedRig rig = Prepare(MakeRing(3));
  const double no = std::nan("");
  const std::vector<PointLabel> labels{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4, 0, 0}};
  const LeftOutFigures all = SummarizeLeftOut(rig, Samples({4, 1, 3, 2, 5}), labels).all;
  EXPECT_DOUBLE_EQ(all.median_px, 3);
  EXPECT_DOUBLE_EQ(all.p90_px, 4.6);
  EXPECT_DOUBLE_EQ(all.predicted_mean_px, 3);
  const LeftOutFigures refuses_hard = SummarizeLeftOut(rig, Samples({no, 1, 3, 2, no}), labels).all;
  EXPECT_DOUBLE_EQ(refuses_hard.median_px, 3);
  EXPECT_DOUBLE_EQ(refuses_hard.predicted_median_px, 2);
  EXPECT_DOUBLE_EQ(refuses_hard.coverage, 0.6);
  EXPECT_TRUE(std::isinf(refuses_hard.p90_px));
  const LeftOutFigures refuses_most = SummarizeLeftOut(rig, Samples({no, 1, no, 2, no}), labels).all;
  EXPECT_TRUE(std::isinf(refuses_most.median_px));
}

/// The standard error of a median of n independent exponential variables of mean 1 tends to 1 / sqrt(n).
TEST(SummarizeLeftOut, StandardErrorOfTheMedian) {
  const PreparedRig rig = Prepare(MakeRing(3));
  Rng rng(7);
  std::vector<double> errors;
  std::vector<PointLabel> labels;
  for (int i = 0; i < 10000; ++i) errors.push_back(-std::log(1 - rng.Uniform())), labels.push_back({i, 0, 0});
  EXPECT_NEAR(SummarizeLeftOut(rig, Samples(errors), labels).all.median_error_px, 0.01, 0.004);
}

TEST(CompareLeftOut, SamplesThatNeitherPredictsDoNotCount) {
  const double no = std::nan("");
  std::vector<PointLabel> labels;
  for (int i = 0; i < 5; ++i) labels.push_back({i, 0, 0});
  const PairedDifference d = CompareLeftOut(Samples({1, 2, 3, no, no}), Samples({2, 3, 4, no, no}), labels);
  EXPECT_EQ(d.num_samples, 3);
  EXPECT_DOUBLE_EQ(d.median_px, 1);
  EXPECT_THROW(CompareLeftOut(Samples({1, 2}), Samples({1}), labels), ContractViolation);
}

std::vector<MethodCandidate> Candidates(const PreparedRig& rig) {
  // Gives up where two views disagree by much: good points only, few of them.
  const auto picky = [&rig](const std::vector<Observation>& seen) {
    Point point = TriangulatePoint(rig, seen);
    if (point.rms_px > 0.6) point.status = Status::kOutlier;
    return point;
  };
  return {{"robust", 3, SolverOf(rig)},
          {"all-views", 2, SolverOf(rig, PointMethod::kAllViews)},
          {"linear", 1, SolverOf(rig, PointMethod::kLinear)},
          {"picky", 0, picky}};
}

TEST(ChooseMethod, CheapestWhereNothingIsGained) {
  const Scene scene = MakeScene(5, 40, 1, 0, 8);
  const MethodChoice choice = ChooseMethod(scene.prepared, scene.points, scene.labels, Candidates(scene.prepared), {}, 2);
  EXPECT_EQ(choice.status, Status::kOk);
  EXPECT_EQ(choice.scores[choice.chosen].name, "linear") << choice.reason;
}

TEST(ChooseMethod, RobustWhereDetectionsLie) {
  const Scene scene = MakeScene(6, 40, 1, 0.2, 9);
  const MethodChoice choice = ChooseMethod(scene.prepared, scene.points, scene.labels, Candidates(scene.prepared), {}, 2);
  EXPECT_EQ(choice.scores[choice.chosen].name, "robust") << choice.reason;
  EXPECT_FALSE(choice.scores[3].justified);
  EXPECT_LT(choice.scores[3].figures.predicted_median_px, choice.scores[0].figures.predicted_median_px);
}

/// A tenth of the points is enough to tell by the 90 % quantile what the median does not see.
TEST(ChooseMethod, RareGrossErrorsCount) {
  const Scene scene = MakeScene(6, 60, 1, 0.02, 10);
  const MethodChoice choice = ChooseMethod(scene.prepared, scene.points, scene.labels, Candidates(scene.prepared), {}, 2);
  EXPECT_EQ(choice.scores[choice.chosen].name, "robust") << choice.reason;
}

}  // namespace
}  // namespace mvstudio::triangulate
