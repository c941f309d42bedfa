#include "triangulate/take/take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "core/error.h"
#include "tests/triangulate/support.h"

namespace mvstudio::triangulate {
namespace {

using ::testing::HasSubstr;
constexpr int kJoints = 15;
constexpr int kFrames = 30;

/// A bunch of joints that walks around `middle`. (kFrames)(kJoints)
std::vector<std::vector<Eigen::Vector3d>> MakeMotion(const Eigen::Vector3d& middle, uint64_t seed) {
  Rng rng(seed);
  std::vector<Eigen::Vector3d> rest;
  for (int j = 0; j < kJoints; ++j) rest.push_back(RandomPoint(&rng, 0.4));
  std::vector<std::vector<Eigen::Vector3d>> motion(kFrames, rest);
  for (int f = 0; f < kFrames; ++f) {
    const Eigen::Vector3d way(0.3 * std::sin(0.2 * f), 0.3 * std::cos(0.15 * f), 0);
    for (Eigen::Vector3d& joint : motion[f]) joint += middle + way;
  }
  return motion;
}

DetectedPerson Detect(const geometry::RigCamera& camera, const std::vector<Eigen::Vector3d>& joints, double noise_px,
                      Rng* rng) {
  DetectedPerson person;
  for (const Eigen::Vector3d& joint : joints) {
    const auto projection = geometry::Project(camera.camera, camera.cam_from_world * joint);
    const bool seen = projection.status == Status::kOk && geometry::InImage(camera.camera, projection.px);
    const Eigen::Vector2d noise(rng->Normal(), rng->Normal());
    person.push_back(seen ? Keypoint{projection.px + noise_px * noise, 0.9} : Keypoint{});
  }
  return person;
}

std::vector<DetectedFrame> DetectAll(const geometry::Rig& rig, const std::vector<std::vector<Eigen::Vector3d>>& motion,
                                     double noise_px, uint64_t seed) {
  Rng rng(seed);
  std::vector<DetectedFrame> frames;
  for (int f = 0; f < kFrames; ++f) {
    DetectedFrame frame{10 + f, {}};
    for (const geometry::RigCamera& camera : rig.cameras) frame.people.push_back({Detect(camera, motion[f], noise_px, &rng)});
    frames.push_back(std::move(frame));
  }
  return frames;
}

double WorstErrorOfPerson0(const TakeResult& take, const std::vector<std::vector<Eigen::Vector3d>>& motion, int* num_ok) {
  double worst = 0;
  *num_ok = 0;
  for (const TakePoint& entry : take.points) {
    if (entry.person != 0 || entry.point.status != Status::kOk) continue;
    ++*num_ok;
    worst = std::max(worst, (entry.point.x_in_world - motion[entry.frame - 10][entry.joint_idx]).norm());
  }
  return worst;
}

TEST(TriangulateTake, OnePerson) {
  const geometry::Rig rig = MakeRing(6);
  const auto motion = MakeMotion({0, 0, 0}, 1);
  const TakeResult take = TriangulateTake(rig, DetectAll(rig, motion, 1.0, 2), kJoints, {});
  int num_ok = 0;
  EXPECT_LT(WorstErrorOfPerson0(take, motion, &num_ok), 0.02);
  EXPECT_EQ(num_ok, kFrames * kJoints);
  EXPECT_EQ(take.num_persons, 1);
  // Scores of 0.9 everywhere: sigma is that of a score of 1.
  EXPECT_NEAR(take.sigma_px, std::sqrt(0.9), 0.06);
  for (const CameraDiagnosis& camera : take.cameras) {
    EXPECT_FALSE(camera.off || camera.scaled) << camera.message;
    EXPECT_LT(camera.mean_residual_px.norm(), 0.3);
  }
}

TEST(TriangulateTake, SameBytesForAnyNumberOfThreads) {
  const geometry::Rig rig = MakeRing(6);
  auto frames = DetectAll(rig, MakeMotion({0, 0, 0}, 1), 2.0, 2);
  Rng rng(3);
  for (DetectedFrame& frame : frames) {
    for (Keypoint& key : frame.people[rng.Index(6)][0]) key.px += Eigen::Vector2d(100 * rng.Normal(), 100 * rng.Normal());
  }
  RunContext one, many;
  one.num_threads = 1, many.num_threads = 5;
  const TakeResult a = TriangulateTake(rig, frames, kJoints, {}, one), b = TriangulateTake(rig, frames, kJoints, {}, many);
  ASSERT_EQ(a.points.size(), b.points.size());
  EXPECT_EQ(a.sigma_px, b.sigma_px);
  for (size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_EQ(a.points[i].point.status, b.points[i].point.status);
    EXPECT_EQ(0, std::memcmp(a.points[i].point.x_in_world.data(), b.points[i].point.x_in_world.data(), 3 * sizeof(double)));
    EXPECT_EQ(0, std::memcmp(a.points[i].point.covariance.data(), b.points[i].point.covariance.data(), 9 * sizeof(double)));
  }
}

TEST(TriangulateTake, GhostsDoNotDisturbTheOnePerson) {
  const geometry::Rig rig = MakeRing(6);
  const auto motion = MakeMotion({0, 0, 0}, 1);
  auto frames = DetectAll(rig, motion, 1.0, 2);
  Rng rng(5);
  for (DetectedFrame& frame : frames) {
    for (int k = 0; k < 2; ++k) {  // a false person, listed first, in two cameras
      DetectedPerson ghost;
      for (int j = 0; j < kJoints; ++j) ghost.push_back({{rng.Uniform(0, 1279), rng.Uniform(0, 959)}, 0.95});
      auto& people = frame.people[rng.Index(6)];
      people.insert(people.begin(), ghost);
    }
    frame.people[rng.Index(6)].clear();  // and the real one is missed somewhere
  }
  const TakeResult take = TriangulateTake(rig, frames, kJoints, {});
  int num_ok = 0;
  EXPECT_LT(WorstErrorOfPerson0(take, motion, &num_ok), 0.03);
  EXPECT_EQ(num_ok, kFrames * kJoints);
  EXPECT_EQ(take.num_persons, 1);
}

TEST(TriangulateTake, TwoPeopleKeepTheirNumbers) {
  const geometry::Rig rig = MakeRing(6, 4);
  const auto first = MakeMotion({0.7, 0, 0}, 1), second = MakeMotion({-0.7, 0, 0}, 2);
  auto frames = DetectAll(rig, first, 1.0, 3);
  const auto others = DetectAll(rig, second, 1.0, 4);
  for (int f = 0; f < kFrames; ++f) {
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      if (c == 5) continue;  // the second person is hidden from one camera: the first is better supported
      auto& people = frames[f].people[c];
      people.insert((f + c) % 2 ? people.end() : people.begin(), others[f].people[c][0]);
    }
  }
  TakeOptions options;
  options.max_persons = 2;
  const TakeResult take = TriangulateTake(rig, frames, kJoints, options);
  EXPECT_EQ(take.num_persons, 2);
  ASSERT_EQ(take.points.size(), 2u * kFrames * kJoints);
  for (const TakePoint& entry : take.points) {
    ASSERT_EQ(entry.point.status, Status::kOk);
    const auto& motion = entry.person == 0 ? first : second;
    EXPECT_LT((entry.point.x_in_world - motion[entry.frame - 10][entry.joint_idx]).norm(), 0.03);
  }
}

TEST(TriangulateTake, APersonWhoJumpsKeepsItsNumber) {
  const geometry::Rig rig = MakeRing(6, 4);
  auto motion = MakeMotion({0.8, 0, 0}, 1);
  const auto after = MakeMotion({-0.8, 0, 0}, 2);
  for (int f = kFrames / 2; f < kFrames; ++f) motion[f] = after[f];  // a cut
  auto frames = DetectAll(rig, motion, 1.0, 3);
  Rng rng(5);
  for (DetectedFrame& frame : frames) {
    DetectedPerson ghost(kJoints, Keypoint{{rng.Uniform(0, 1279), rng.Uniform(0, 959)}, 0.95});
    frame.people[1].push_back(ghost);
  }
  int num_ok = 0;
  EXPECT_LT(WorstErrorOfPerson0(TriangulateTake(rig, frames, kJoints, {}), motion, &num_ok), 0.03);
  EXPECT_EQ(num_ok, kFrames * kJoints);
}

TEST(TriangulateTake, EmptyAndHopelessInput) {
  const geometry::Rig rig = MakeRing(3);
  EXPECT_TRUE(TriangulateTake(rig, {}, kJoints, {}).points.empty());
  std::vector<DetectedFrame> frames = {{0, {{}, {}, {}}}, {1, {{DetectedPerson(kJoints)}, {DetectedPerson(kJoints)}, {}}}};
  const TakeResult take = TriangulateTake(rig, frames, kJoints, {});
  EXPECT_EQ(take.points.size(), 2u * kJoints);
  for (const TakePoint& entry : take.points) EXPECT_EQ(entry.point.status, Status::kTooFewViews);
}

TEST(TriangulateTake, OptionsAreChecked) {
  const geometry::Rig rig = MakeRing(3);
  const auto expect_usage_error = [&rig](const TakeOptions& options) {
    EXPECT_THROW(TriangulateTake(rig, {}, kJoints, options), UsageError);
  };
  TakeOptions options;
  options.sigma_px = -1;
  expect_usage_error(options);
  options = {};
  options.min_views = 1;
  expect_usage_error(options);
  EXPECT_THROW(TriangulateTake(rig, {{0, {{}}}}, kJoints, {}), ContractViolation);
  EXPECT_THROW(TriangulateTake(rig, {{0, {{DetectedPerson(3)}, {}, {}}}}, kJoints, {}), ContractViolation);
}

TEST(TakeMethod, HasAWordForEveryMethod) {
  TakeMethod method;
  for (const char* word : {"exhaustive-dlt", "robust", "linear", "linf", "auto"}) {
    FromString(word, &method);
    EXPECT_EQ(ToString(method), word);
  }
  EXPECT_THROW(FromString("best", &method), UsageError);
}

TEST(Diagnosis, NamesTheShiftedCamera) {
  const geometry::Rig rig = MakeRing(8);
  auto frames = DetectAll(rig, MakeMotion({0, 0, 0}, 1), 1.0, 2);
  for (const Eigen::Vector2d& shift : {Eigen::Vector2d(8, -6), Eigen::Vector2d(40, 10), Eigen::Vector2d(0, 3)}) {
    auto shifted = frames;
    for (DetectedFrame& frame : shifted) {
      for (Keypoint& key : frame.people[3][0]) key.px += shift;
    }
    const TakeResult take = TriangulateTake(rig, shifted, kJoints, {});
    for (size_t c = 0; c < take.cameras.size(); ++c)
      EXPECT_EQ(take.cameras[c].off, c == 3) << c << " " << take.cameras[c].message;
    EXPECT_THAT(take.cameras[3].message, HasSubstr("cam_3: detections are off by"));
    EXPECT_LT((take.cameras[3].mean_left_out_residual_px - shift).norm(), 0.2 * shift.norm());
  }
}

TEST(Diagnosis, NamesTheScaledCamera) {
  const geometry::Rig rig = MakeRing(8);
  auto frames = DetectAll(rig, MakeMotion({0, 0, 0}, 1), 0.5, 2);
  const double scale = 1080.0 / 1088;
  for (DetectedFrame& frame : frames) {
    for (Keypoint& key : frame.people[5][0]) key.px.x() = scale * (key.px.x() + 0.5) - 0.5;
  }
  const TakeResult take = TriangulateTake(rig, frames, kJoints, {});
  for (size_t c = 0; c < take.cameras.size(); ++c)
    EXPECT_EQ(take.cameras[c].off || take.cameras[c].scaled, c == 5) << take.cameras[c].message;
  EXPECT_NEAR(take.cameras[5].image_scale.x(), scale, 0.0015);
  EXPECT_NEAR(take.cameras[5].image_scale.y(), 1, 0.0015);
}

}  // namespace
}  // namespace mvstudio::triangulate
