#include "triangulate/take/stream.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/triangulate/support.h"
#include "triangulate/take/blocks.h"
#include "triangulate/take/steps.h"

namespace mvstudio::triangulate {
namespace {

constexpr int kJoints = 6;

/// Two people who walk past each other along x, half a metre apart, listed in an order that changes from image to image.
std::vector<DetectedFrame> Crossing(const geometry::Rig& rig, int num_frames) {
  Rng rng(21);
  std::vector<DetectedFrame> frames;
  for (int f = 0; f < num_frames; ++f) {
    DetectedFrame frame{f, std::vector<std::vector<DetectedPerson>>(rig.cameras.size())};
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      for (int p = 0; p < 2; ++p) {
        const double along = -0.5 + 1.0 * f / num_frames;
        DetectedPerson person;
        for (int j = 0; j < kJoints; ++j) {
          const Eigen::Vector3d x(p ? -along : along, p ? 0.25 : -0.25, -0.3 + 0.12 * j + 0.05 * p);
          const auto seen = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x);
          person.push_back({seen.px + Eigen::Vector2d(rng.Normal(), rng.Normal()), 1.0});
        }
        auto& people = frame.people[c];
        people.insert((f + static_cast<int>(c)) % 2 ? people.begin() : people.end(), person);
      }
    }
    frames.push_back(frame);
  }
  return frames;
}

TEST(TakeStream, GivesThePointsAndPersonsOfTheWholeTake) {
  const geometry::Rig rig = MakeRing(5);
  const std::vector<DetectedFrame> frames = Crossing(rig, 140);
  TakeOptions options;
  options.max_persons = 2;
  options.sigma_px = 1;
  options.method = ByPoint(PointMethod::kRobust);
  options.holdout_points = 0;
  const TakeResult whole = TriangulateTake(rig, frames, kJoints, options);
  TakeStream stream(rig, kJoints, options);
  std::vector<TakePoint> points;
  for (size_t begin = 0; begin < frames.size(); begin += 45) {
    const auto end = frames.begin() + static_cast<std::ptrdiff_t>(std::min(begin + 45, frames.size()));
    const TakeResult part = stream.Push({frames.begin() + static_cast<std::ptrdiff_t>(begin), end}, {});
    EXPECT_EQ(part.num_persons, 2);
    EXPECT_EQ(part.points.size(), part.observations.size());
    points.insert(points.end(), part.points.begin(), part.points.end());
  }
  ASSERT_EQ(points.size(), whole.points.size());
  std::map<std::tuple<int, int, int>, Point> expected;
  for (const TakePoint& point : whole.points) expected[{point.frame, point.person, point.joint_idx}] = point.point;
  // The numbers of the two may be exchanged, but then everywhere.
  const bool swapped = (points[0].point.x_in_world - expected[{points[0].frame, points[0].person, 0}].x_in_world).norm() > 0.1;
  for (const TakePoint& point : points) {
    const Point& other = expected[{point.frame, swapped ? 1 - point.person : point.person, point.joint_idx}];
    ASSERT_EQ(point.point.status, other.status);
    EXPECT_EQ(point.point.x_in_world, other.x_in_world) << "frame " << point.frame << " person " << point.person;
  }
}

/// More frames than a block has. Solved by themselves, the points are the same; a take's spread frames stay.
TEST(TakeBlocks, GiveThePointsOfTheWholeAndKeepSomeFrames) {
  constexpr size_t kFrames = kTakeBlockFrames + 120, kKept = 50;
  const geometry::Rig rig = MakeRing(4);
  const std::vector<DetectedFrame> frames = Crossing(rig, static_cast<int>(kFrames));
  TakeOptions options;
  options.max_persons = 2;
  options.method = ByPoint(PointMethod::kRobust);
  options.holdout_points = 300;
  const TakeProblem problem = PrepareTake(rig, frames, kJoints, options, {});
  const PointSolver solve = SolverFor(rig, problem, options, options.method);
  const std::vector<Point> expected = SolvePoints(problem, solve, 1);
  TakeBlocks blocks(rig, frames, kJoints, options, {}, kKept);
  size_t at = 0, num_blocks = 0;
  for (TakeResult block; blocks.Next(&block); ++num_blocks) {
    ASSERT_EQ(block.points.size(), block.observations.size());
    for (size_t i = 0; i < block.points.size(); ++i, ++at) {
      ASSERT_EQ(block.points[i].frame, problem.labels[at].frame);
      ASSERT_EQ(block.points[i].point.status, expected[at].status);
      EXPECT_EQ(block.points[i].point.x_in_world, expected[at].x_in_world);
      EXPECT_EQ(block.points[i].point.covariance, expected[at].covariance);
    }
  }
  EXPECT_EQ(at, expected.size());
  EXPECT_EQ(num_blocks, 2u);
  const TakeResult kept = blocks.Finish();
  std::set<int> numbers;
  for (const TakePoint& point : kept.points) numbers.insert(point.frame);
  EXPECT_LE(numbers.size(), kKept);
  EXPECT_GT(numbers.size(), kKept * 9 / 10);
  EXPECT_GT(*numbers.rbegin(), static_cast<int>(kFrames * 9 / 10)) << "to the end";
  EXPECT_EQ(kept.sigma_px, problem.sigma_px);
  EXPECT_EQ(kept.holdout.all.num_samples, HoldOut(problem, solve, options.holdout_points, 1).all.num_samples);
  EXPECT_EQ(kept.holdout.all.median_px, HoldOut(problem, solve, options.holdout_points, 1).all.median_px);
  EXPECT_EQ(kept.cameras.size(), rig.cameras.size());
}

TEST(TakeStream, SettlesNoiseAndMethodFromASample) {
  const geometry::Rig rig = MakeRing(5);
  const std::vector<DetectedFrame> frames = Crossing(rig, 40);
  TakeOptions options;
  options.max_persons = 2;
  TakeResult sample;
  const TakeOptions settled = SettleOptions(rig, frames, kJoints, options, {}, &sample);
  EXPECT_NEAR(settled.sigma_px, 1, 0.1);
  EXPECT_FALSE(settled.method.IsAuto());
  EXPECT_EQ(settled.holdout_points, 0);
  EXPECT_TRUE(settled.select_views);
  EXPECT_GT(sample.holdout.all.num_samples, 100);
}

}  // namespace
}  // namespace mvstudio::triangulate
