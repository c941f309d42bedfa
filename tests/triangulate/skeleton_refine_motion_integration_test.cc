#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "core/error.h"
#include "tests/triangulate/support.h"
#include "triangulate/skeleton/refine.h"
#include "triangulate/skeleton/window.h"

/// A walking stick figure with bones of constant length, and others without.
namespace mvstudio::triangulate {
namespace {

constexpr int kJoints = 6;
const std::vector<std::pair<int, int>> kBones{{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}};

struct Take {
  geometry::Rig rig;
  PreparedRig prepared;
  TakeResult result;
  std::vector<Eigen::Vector3d> truth;  // of each point
};

struct Scene {
  int num_cameras = 4, num_frames = 60;
  double noise_px = 1.5;
  double stretch = 0;                    // bones breathe by this part of their length
  double outliers = 0;                   // of the detections
  int blind_first = 0, blind_last = -1;  // frames in which nobody sees joint 3
  double tremor_m = 0;                   // of every joint in every frame
  int cut = 1 << 20;                     // from this frame on everything is 0.9 m further
  bool still = false;
  uint64_t seed = 1;
};

/// A chain whose bones turn by sums of sinusoids.
Eigen::Vector3d JointAt(const Scene& scene, int joint, double frame) {
  if (scene.still) frame = 0;
  const double t = frame / 30;
  Eigen::Vector3d x(0.3 * std::sin(1.1 * t), 0.2 * std::cos(0.7 * t), -0.4);
  for (int j = 1; j <= joint; ++j) {
    const double a = 0.8 * std::sin(1.9 * t + j) + j, b = 0.5 * std::sin(2.7 * t - 0.7 * j);
    const double length = (0.12 + 0.05 * j) * (1 + scene.stretch * std::sin(3.1 * t + 2 * j));
    x += length * Eigen::Vector3d(std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), 0.6 + 0.4 * std::sin(b)).normalized();
  }
  return x;
}

PointSolver Solver(const PreparedRig& rig) {
  return [&rig](const std::vector<Observation>& seen) { return TriangulatePoint(rig, seen); };
}

void Film(const Scene& scene, Take* take) {
  take->rig = MakeRing(scene.num_cameras);
  take->prepared = Prepare(take->rig);
  take->result.num_persons = 1;
  take->result.sigma_px = scene.noise_px;
  Rng rng(scene.seed);
  for (int f = 0; f < scene.num_frames; ++f) {
    for (int j = 0; j < kJoints; ++j) {
      Eigen::Vector3d x = JointAt(scene, j, f);
      if (f >= scene.cut) x.x() += 0.9;
      x += scene.tremor_m * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
      auto seen = Observe(take->rig, x, scene.noise_px, &rng, scene.noise_px);
      for (Observation& each : seen) {
        if (rng.Uniform() < scene.outliers) each.px += Eigen::Vector2d(rng.Uniform(-150, 150), rng.Uniform(-150, 150));
      }
      if (j == 3 && f >= scene.blind_first && f <= scene.blind_last) seen.clear();
      take->truth.push_back(x);
      take->result.points.push_back({f, 0, j, TriangulatePoint(take->prepared, seen)});
      take->result.observations.push_back(seen);
    }
  }
}

double RmsError(const Take& take, const std::vector<TakePoint>& points) {
  double sum = 0;
  int count = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    if (take.result.points[i].point.status != Status::kOk) continue;
    sum += (points[i].point.x_in_world - take.truth[i]).squaredNorm(), ++count;
  }
  return std::sqrt(sum / count);
}

SkeletonRefineResult Refine(const Take& take, const SkeletonRefineOptions& options = {}, int num_threads = 2) {
  RunContext run;
  run.num_threads = num_threads;
  return RefineSkeleton(take.prepared, take.result, kBones, Solver(take.prepared), options, run);
}

TEST(SkeletonRefine, SmoothMotionOfConstantBonesGainsMuch) {
  Take take;
  Film({}, &take);
  const SkeletonRefineResult refined = Refine(take);
  EXPECT_GT(refined.report.smoothness, 0);
  EXPECT_GT(refined.report.bone_lengths, 0);
  const double before = RmsError(take, take.result.points), after = RmsError(take, refined.points);
  std::printf("rms error %.2f -> %.2f mm, held-out %.3f -> %.3f px\n", 1e3 * before, 1e3 * after,
              refined.report.before.median_px, refined.report.after.median_px);
  EXPECT_LT(after, 0.6 * before);
  EXPECT_LT(refined.report.after.median_px, refined.report.before.median_px);
  EXPECT_LT(refined.report.limb_std_after_mm, 0.5 * refined.report.limb_std_before_mm);
  for (size_t b = 0; b < kBones.size(); ++b) {
    const BoneReport& bone = refined.report.bones[b];
    EXPECT_EQ(bone.num_frames, 60);
    EXPECT_NEAR(bone.length_m, 0.12 + 0.05 * bone.joint_b, 0.002);
  }
}

/// Accelerations drawn from the very model: the covariance is that of the errors, one sample every tenth frame.
TEST(SkeletonRefine, CovarianceOfTheModelItself) {
  constexpr double kAcceleration = 0.003, kNoisePx = 3;
  const geometry::Rig rig = MakeRing(3);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(11);
  int inside68 = 0, inside95 = 0, count = 0;
  for (int run = 0; run < 120; ++run) {
    internal::Window window{0, {}, 1, {}};
    std::vector<Eigen::Vector3d> truth{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    for (int f = 0; f < 40; ++f) {
      if (f >= 2) {
        const Eigen::Vector3d acceleration(rng.Normal(), rng.Normal(), rng.Normal());
        truth.push_back(2 * truth[truth.size() - 1] - truth[truth.size() - 2] + kAcceleration * acceleration);
      }
      const auto seen = Observe(rig, truth[static_cast<size_t>(f)], kNoisePx, &rng, kNoisePx);
      window.frames.push_back(f);
      window.cells.push_back({0, TriangulatePoint(prepared, seen), seen});
    }
    internal::Terms terms;
    terms.smoothness = 1, terms.acceleration_m = {kAcceleration}, terms.max_fill_frames = 5, terms.max_fill_sigmas = 3;
    const auto solution = internal::SolveWindow(prepared, window, {}, {}, terms, 20);
    for (size_t f = 5; f < 40; f += 10) {
      const Point& point = solution.points[f];
      if (point.status != Status::kOk) continue;
      const Eigen::Vector3d error = point.x_in_world - truth[f];
      const double d2 = error.dot(point.covariance.inverse() * error);
      inside68 += d2 < 3.5059, inside95 += d2 < 7.8147, ++count;
    }
  }
  std::printf("coverage %.3f and %.3f over %d\n", double(inside68) / count, double(inside95) / count, count);
  ASSERT_GT(count, 450);
  EXPECT_NEAR(double(inside68) / count, 0.68, 4 * std::sqrt(0.68 * 0.32 / count));
  EXPECT_NEAR(double(inside95) / count, 0.95, 4 * std::sqrt(0.95 * 0.05 / count));
}

/// Motion that is smoother than the model takes it to be: the covariance is too large rather than too small.
TEST(SkeletonRefine, CovarianceIsNotTooSmall) {
  int inside68 = 0, inside95 = 0, count = 0;
  for (uint64_t seed = 0; seed < 4; ++seed) {
    Scene scene;
    scene.seed = 20 + seed;
    Take take;
    Film(scene, &take);
    const SkeletonRefineResult refined = Refine(take);
    EXPECT_GT(refined.report.smoothness, 0);
    for (size_t i = 0; i < refined.points.size(); ++i) {
      if (refined.points[i].frame % 10 != 5) continue;
      const Point& point = refined.points[i].point;
      const Eigen::Vector3d error = point.x_in_world - take.truth[i];
      const double d2 = error.dot(point.covariance.inverse() * error);
      inside68 += d2 < 3.5059, inside95 += d2 < 7.8147, ++count;
    }
  }
  std::printf("coverage %.3f and %.3f over %d\n", double(inside68) / count, double(inside95) / count, count);
  EXPECT_GT(double(inside68) / count, 0.68 - 4 * std::sqrt(0.68 * 0.32 / count));
  EXPECT_GT(double(inside95) / count, 0.95 - 4 * std::sqrt(0.95 * 0.05 / count));
}

/// Two clips that follow each other: neither smoothed together nor filled in between.
TEST(SkeletonRefine, AHardCutIsNotBridged) {
  Scene scene;
  scene.cut = 30;
  Take take;
  Film(scene, &take);
  const SkeletonRefineResult refined = Refine(take);
  EXPECT_GT(refined.report.smoothness, 0);
  EXPECT_LT(RmsError(take, refined.points), 0.6 * RmsError(take, take.result.points));
  double worst_m = 0;
  for (size_t i = 0; i < refined.points.size(); ++i) {
    if (refined.points[i].frame < 28 || refined.points[i].frame > 31) continue;
    worst_m = std::max(worst_m, (refined.points[i].point.x_in_world - take.truth[i]).norm());
  }
  EXPECT_LT(worst_m, 0.03);

  scene.blind_first = 29, scene.blind_last = 30;
  Take gap;
  Film(scene, &gap);
  SkeletonRefineOptions options;
  options.max_fill_sigmas = 1e6;
  EXPECT_EQ(Refine(gap, options).report.num_filled, 0);
  scene.cut = 1 << 20;
  Take whole;
  Film(scene, &whole);
  EXPECT_EQ(Refine(whole, options).report.num_filled, 2);
}

TEST(SkeletonRefine, StretchingBonesAreNotForced) {
  Scene scene;
  scene.stretch = 0.15;
  Take take;
  Film(scene, &take);
  SkeletonRefineOptions options;
  options.smoothness = AutoOnOff::kOff;
  const SkeletonRefineResult refined = Refine(take, options);
  EXPECT_TRUE(refined.report.bone_lengths == 0 || refined.report.bone_lengths == 0.1) << refined.report.bone_lengths;
  options.bone_lengths = AutoOnOff::kOff;
  EXPECT_LT(RmsError(take, refined.points), 1.05 * RmsError(take, Refine(take, options).points));
}

/// Joints that jump at random from frame to frame are not smoothed over.
TEST(SkeletonRefine, TremorIsNotSmoothed) {
  Scene scene;
  scene.tremor_m = 0.05;
  Take take;
  Film(scene, &take);
  const SkeletonRefineResult refined = Refine(take);
  EXPECT_TRUE(refined.report.smoothness == 0 || refined.report.smoothness == 1) << refined.report.smoothness;
  EXPECT_EQ(refined.report.bone_lengths, 0);
  EXPECT_LT(RmsError(take, refined.points), 1.05 * RmsError(take, take.result.points));
}

TEST(SkeletonRefine, OutliersDoNotSpread) {
  Scene scene;
  scene.num_cameras = 6, scene.outliers = 0.15;
  Take take;
  Film(scene, &take);
  const SkeletonRefineResult refined = Refine(take);
  EXPECT_LT(RmsError(take, refined.points), 0.8 * RmsError(take, take.result.points));
}

TEST(SkeletonRefine, BridgesShortGapsOnly) {
  Scene scene;
  scene.blind_first = 20, scene.blind_last = 23;
  Take take;
  Film(scene, &take);
  const SkeletonRefineResult refined = Refine(take);
  EXPECT_EQ(refined.report.num_filled, 4);
  for (size_t i = 0; i < refined.points.size(); ++i) {
    if (take.result.points[i].point.status == Status::kOk) continue;
    const Point& point = refined.points[i].point;
    EXPECT_EQ(point.status, Status::kOk);
    EXPECT_TRUE(point.used.empty());
    const Eigen::Vector3d error = point.x_in_world - take.truth[i];
    EXPECT_LT(error.dot(point.covariance.inverse() * error), 14.2);  // 99.7 %
  }
  Take longer;
  scene.blind_last = 44;
  Film(scene, &longer);
  const SkeletonRefineResult kept = Refine(longer);
  EXPECT_EQ(kept.report.num_filled, 0);
  for (size_t i = 0; i < kept.points.size(); ++i) {
    EXPECT_EQ(kept.points[i].point.status, longer.result.points[i].point.status);
  }
}

TEST(SkeletonRefine, TwoCamerasDecideNothing) {
  Scene scene;
  scene.num_cameras = 2;
  Take take;
  Film(scene, &take);
  const SkeletonRefineResult refined = Refine(take);
  EXPECT_EQ(refined.report.robust + refined.report.smoothness + refined.report.bone_lengths, 0);
  for (size_t i = 0; i < refined.points.size(); ++i) {
    EXPECT_EQ(refined.points[i].point.x_in_world, take.result.points[i].point.x_in_world);
  }
  SkeletonRefineOptions on;
  on.smoothness = AutoOnOff::kOn;
  EXPECT_GT(Refine(take, on).report.smoothness, 0);
}

/// A joint that is never seen three times in a row has no acceleration: it is not bridged, and the others are refined.
TEST(SkeletonRefine, AJointSeenEverySecondFrame) {
  Take take;
  Film({}, &take);
  for (size_t i = 0; i < take.result.points.size(); ++i) {
    if (take.result.points[i].joint_idx != 2 || take.result.points[i].frame % 2 == 0) continue;
    take.result.points[i].point = {}, take.result.observations[i].clear();
  }
  const SkeletonRefineResult refined = Refine(take);
  EXPECT_EQ(refined.report.num_unrefined_frames, 0);
  EXPECT_GT(refined.report.smoothness, 0);
  EXPECT_LT(RmsError(take, refined.points), 0.7 * RmsError(take, take.result.points));
}

TEST(SkeletonRefine, EmptyTakeAndWrongOptions) {
  Take take;
  Film({}, &take);
  TakeResult empty;
  EXPECT_TRUE(RefineSkeleton(take.prepared, empty, kBones, Solver(take.prepared), {}).points.empty());
  SkeletonRefineOptions options;
  options.max_fill_sigmas = 0;
  EXPECT_THROW(Refine(take, options), UsageError);
}

/// A stretch of a long take lasts seconds: who interrupts waits for one of its steps only.
TEST(SkeletonRefine, AStretchIsInterruptedBetweenItsSteps) {
  class Impatient : public ProgressSink {
   public:
    explicit Impatient(int patience) : patience_(patience) {}
    bool Cancelled() const override { return patience_-- <= 0; }

   private:
    mutable int patience_;
  };
  Scene scene;
  scene.num_frames = 10;
  Take take;
  Film(scene, &take);
  internal::Window window{0, {}, kJoints, {}};
  for (size_t i = 0; i < take.result.points.size(); ++i) {
    if (i % kJoints == 0) window.frames.push_back(take.result.points[i].frame);
    window.cells.push_back({i, take.result.points[i].point, take.result.observations[i]});
  }
  internal::Terms terms;
  terms.smoothness = 1, terms.acceleration_m.assign(kJoints, 0.001);
  for (const int patience : {0, 1, 1000}) {
    Impatient sink(patience);
    RunContext run;
    run.progress = &sink;
    const auto solve = [&] { internal::SolveWindow(take.prepared, window, {}, {}, terms, 20, run); };
    if (patience < 1000) {
      EXPECT_THROW(solve(), CancelledError) << patience;
    } else {
      EXPECT_NO_THROW(solve());
    }
  }
}

TEST(SkeletonRefine, SameForAnyNumberOfThreads) {
  Scene scene;
  scene.num_frames = 25;
  Take take;
  Film(scene, &take);
  const SkeletonRefineResult one = Refine(take, {}, 1), three = Refine(take, {}, 3);
  for (size_t i = 0; i < one.points.size(); ++i) {
    EXPECT_EQ(one.points[i].point.x_in_world, three.points[i].point.x_in_world);
  }
}

/// Windows of a long take meet without a seam, and hold one length a bone.
TEST(SkeletonRefine, LongTakes) {
  Scene scene;
  scene.num_frames = 700;
  Take take;
  Film(scene, &take);
  SkeletonRefineOptions options;
  options.choice_frames = 60;
  const SkeletonRefineResult refined = Refine(take, options);
  EXPECT_LT(RmsError(take, refined.points), 0.6 * RmsError(take, take.result.points));
  double step_at_seam = 0, largest = 0;
  for (size_t i = 0; i + kJoints < refined.points.size(); ++i) {
    const double step = (refined.points[i + kJoints].point.x_in_world - refined.points[i].point.x_in_world -
                         take.truth[i + kJoints] + take.truth[i])
                            .norm();
    largest = std::max(largest, step);
    if (refined.points[i].frame == 599) step_at_seam = std::max(step_at_seam, step);
  }
  EXPECT_LT(step_at_seam, 0.9 * largest + 1e-9);
}

}  // namespace
}  // namespace mvstudio::triangulate
