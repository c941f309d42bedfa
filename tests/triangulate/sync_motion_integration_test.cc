#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/triangulate/support.h"
#include "triangulate/sync/sync.h"

/// Motion with known truth, seen by cameras whose clocks differ.
namespace mvstudio::triangulate {
namespace {

constexpr int kJoints = 12;
using Motion = std::function<Eigen::Vector3d(int joint, double frame)>;

Eigen::Vector3d Place(int joint) { return {0.3 * std::cos(2.4 * joint), 0.3 * std::sin(2.4 * joint), 0.12 * joint - 0.7}; }

/// Sums of sinusoids whose frequencies share no multiple; up to some 15 px a frame.
Eigen::Vector3d Lively(int joint, double frame) {
  const double t = frame / 30, phase = 0.7 * joint;
  return Place(joint) + 0.2 * Eigen::Vector3d(std::sin(2.1 * t + phase) + 0.5 * std::sin(5.3 * t), std::sin(1.3 * t - phase),
                                              0.6 * std::sin(3.7 * t + 2 * phase) + 0.3 * std::cos(0.9 * t));
}

Eigen::Vector3d Still(int joint, double) { return Place(joint); }

/// A turn takes 40 frames.
Eigen::Vector3d Periodic(int joint, double frame) {
  const double angle = 2 * kPi * frame / 40 + joint;
  return Place(joint) + 0.2 * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.5 * std::sin(2 * angle));
}

struct Take {
  geometry::Rig rig = MakeRing(5);
  std::vector<double> offsets{0, 7, -12.3, 3.45, -0.6};  // frame f of camera 0 is frame f + offset of the others
  int num_frames = 160;
  double noise_px = 1;
  double outliers = 0;  // of the detections, up to 200 px off
  double missing = 0;   // of the detections
  bool two_people = false;
  uint64_t seed = 3;
};

void SeeJoint(const geometry::RigCamera& camera, const Eigen::Vector3d& x_in_world, const Take& take, Rng* rng,
              DetectedPerson* person) {
  Keypoint& key = person->emplace_back();
  const auto at = geometry::Project(camera.camera, camera.cam_from_world * x_in_world);
  const Eigen::Vector2d noise(rng->Normal(), rng->Normal()), jump(rng->Uniform(-200, 200), rng->Uniform(-200, 200));
  const double lot = rng->Uniform();
  if (at.status != Status::kOk || lot < take.missing) return;
  key.px = at.px + take.noise_px * noise;
  if (lot > 1 - take.outliers) key.px += jump;
  key.score = 0.9;
}

std::vector<DetectedFrame> Film(const Take& take, const Motion& motion) {
  Rng rng(take.seed);
  std::vector<DetectedFrame> frames;
  for (int f = 0; f < take.num_frames; ++f) {
    DetectedFrame& frame = frames.emplace_back();
    frame.frame = f;
    frame.people.resize(take.rig.cameras.size());
    for (size_t c = 0; c < take.rig.cameras.size(); ++c) {
      for (int p = 0; p < (take.two_people ? 2 : 1); ++p) {
        DetectedPerson person;
        for (int j = 0; j < kJoints; ++j) {
          const double at = f - take.offsets[c];
          const Eigen::Vector3d x =
              p == 0 ? motion(j, at) : Eigen::Vector3d(motion(j + 3, at + 500) + Eigen::Vector3d(0.9, 0.2, 0));
          SeeJoint(take.rig.cameras[c], x, take, &rng, &person);
        }
        // People in no particular order.
        frame.people[c].insert(frame.people[c].begin() + (p > 0 && (f + static_cast<int>(c)) % 3 == 0 ? 0 : p), person);
      }
    }
  }
  return frames;
}

SyncResult Sync(const Take& take, const Motion& motion, SyncOptions options = {}) {
  options.reference = "cam_0";
  RunContext run;
  run.num_threads = 2;
  return SynchronizeCameras(Prepare(take.rig), Film(take, motion), options, run);
}

void ExpectOffsets(const SyncResult& result, const Take& take, double tolerance) {
  EXPECT_EQ(result.status, SyncStatus::kOk);
  for (size_t c = 0; c < take.offsets.size(); ++c) {
    const CameraSync& sync = result.cameras[c];
    EXPECT_EQ(sync.status, SyncStatus::kOk) << sync.message;
    EXPECT_NEAR(sync.offset_frames, take.offsets[c] - take.offsets[0], tolerance)
        << sync.name << " sigma " << sync.sigma_frames;
  }
}

void ExpectNothing(const SyncResult& result, SyncStatus status) {
  EXPECT_EQ(result.status, status);
  for (const CameraSync& camera : result.cameras) {
    EXPECT_NE(camera.status, SyncStatus::kOk) << camera.name << " " << camera.offset_frames << " +- " << camera.sigma_frames;
    EXPECT_NE(camera.message, "");
  }
}

TEST(Sync, ExactDetections) {
  Take take;
  take.noise_px = 0;
  const SyncResult result = Sync(take, Lively);
  ExpectOffsets(result, take, 0.01);
  EXPECT_EQ(result.reference_idx, 0);
  EXPECT_LT(result.residual_after_px, 0.1);
  EXPECT_GT(result.residual_before_px, 10);
}

TEST(Sync, NoisyDetections) { ExpectOffsets(Sync({}, Lively), {}, 0.05); }

TEST(Sync, OutliersAndGaps) {
  Take take;
  take.outliers = 0.15, take.missing = 0.2;
  ExpectOffsets(Sync(take, Lively), take, 0.1);
}

TEST(Sync, TwoPeopleInAnyOrder) {
  Take take;
  take.two_people = true;
  ExpectOffsets(Sync(take, Lively), take, 0.1);
}

TEST(Sync, TwoCameras) {
  Take take;
  take.rig.cameras.resize(2);
  take.offsets = {0, -31.7};
  ExpectOffsets(Sync(take, Lively), take, 0.1);
}

/// An image that lies 8 px off everywhere, as with a bumped camera or cropped images.
TEST(Sync, ShiftedImageDoesNotPassAsTime) {
  Take take;
  std::vector<DetectedFrame> frames = Film(take, Lively);
  for (DetectedFrame& frame : frames) {
    for (DetectedPerson& person : frame.people[2]) {
      for (Keypoint& key : person) key.px += Eigen::Vector2d(8, -6);
    }
  }
  SyncOptions options;
  options.reference = "cam_0";
  ExpectOffsets(SynchronizeCameras(Prepare(take.rig), frames, options), take, 0.15);
}

/// Errors in units of the predicted standard deviation: mean square near 1.
TEST(Sync, SigmaIsHonest) {
  double sum = 0;
  int count = 0;
  for (uint64_t seed = 0; seed < 12; ++seed) {
    Take take;
    take.noise_px = 3;
    take.seed = 100 + seed;
    const SyncResult result = Sync(take, Lively);
    for (size_t c = 1; c < take.offsets.size(); ++c) {
      ASSERT_EQ(result.cameras[c].status, SyncStatus::kOk);
      const double z = (result.cameras[c].offset_frames - take.offsets[c]) / result.cameras[c].sigma_frames;
      sum += z * z, ++count;
    }
  }
  std::printf("mean square of error / sigma: %.2f over %d\n", sum / count, count);
  EXPECT_LT(sum / count, 2.0);
  EXPECT_GT(sum / count, 0.4);
}

TEST(Sync, StillPerson) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    Take take;
    take.seed = seed;
    ExpectNothing(Sync(take, Still), SyncStatus::kNoMotion);
  }
}

/// Detections of a real detector err alike in neighbouring frames.
TEST(Sync, StillPersonWithWanderingDetections) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    Take take;
    take.seed = seed;
    std::vector<DetectedFrame> frames = Film(take, Still);
    Rng rng(seed + 50);
    std::vector<std::vector<Eigen::Vector2d>> drift(5, std::vector<Eigen::Vector2d>(kJoints, Eigen::Vector2d::Zero()));
    for (DetectedFrame& frame : frames) {
      for (size_t c = 0; c < 5; ++c) {
        for (size_t j = 0; j < kJoints; ++j) {
          drift[c][j] = 0.95 * drift[c][j] + 0.6 * Eigen::Vector2d(rng.Normal(), rng.Normal());
          frame.people[c][0][j].px += drift[c][j];
        }
      }
    }
    ExpectNothing(SynchronizeCameras(Prepare(take.rig), frames, {}), SyncStatus::kNoMotion);
  }
}

TEST(Sync, PeriodicMotion) {
  for (const double noise_px : {0.0, 1.0}) {
    Take take;
    take.noise_px = noise_px;
    ExpectNothing(Sync(take, Periodic), SyncStatus::kAmbiguous);
    // Within one period there is one answer.
    SyncOptions narrow;
    narrow.max_offset_frames = 18;
    ExpectOffsets(Sync(take, Periodic, narrow), take, 0.1);
  }
}

TEST(Sync, OffsetBeyondTheRange) {
  Take take;
  take.offsets = {0, 1.5, 60, -2, 1};
  SyncOptions options;
  options.max_offset_frames = 20;
  const SyncResult result = Sync(take, Lively, options);
  EXPECT_NE(result.cameras[2].status, SyncStatus::kOk) << result.cameras[2].offset_frames;
  EXPECT_NEAR(result.cameras[1].offset_frames, 1.5, 0.1);
}

TEST(Sync, CamerasWithNothingAreNamed) {
  Take take;
  std::vector<DetectedFrame> frames = Film(take, Lively);
  for (DetectedFrame& frame : frames) frame.people[3].clear();
  const SyncResult result = SynchronizeCameras(Prepare(take.rig), frames, {});
  EXPECT_EQ(result.status, SyncStatus::kTooFewDetections);
  EXPECT_EQ(result.cameras[3].status, SyncStatus::kTooFewDetections);
  const double reference = take.offsets[static_cast<size_t>(result.reference_idx)];
  for (const size_t c : {0, 1, 2, 4}) EXPECT_NEAR(result.cameras[c].offset_frames, take.offsets[c] - reference, 0.1);
}

TEST(Sync, NothingAtAll) {
  Take take;
  ExpectNothing(SynchronizeCameras(Prepare(take.rig), {}, {}), SyncStatus::kTooFewDetections);
  take.num_frames = 6;
  ExpectNothing(Sync(take, Lively), SyncStatus::kTooFewDetections);
}

/// A camera that filmed something else is not made to fit.
TEST(Sync, ForeignFootage) {
  Take take;
  std::vector<DetectedFrame> frames = Film(take, Lively);
  const auto other = Film(take, [](int joint, double frame) { return Lively(joint + 5, 1.7 * frame + 3000); });
  for (size_t f = 0; f < frames.size(); ++f) frames[f].people[4] = other[f].people[4];
  const SyncResult result = SynchronizeCameras(Prepare(take.rig), frames, {});
  EXPECT_NE(result.cameras[4].status, SyncStatus::kOk) << result.cameras[4].offset_frames;
}

TEST(Sync, SameForAnyNumberOfThreads) {
  Take take;
  take.rig.cameras.resize(3);
  take.offsets.resize(3);
  const auto frames = Film(take, Lively);
  RunContext one, three;
  one.num_threads = 1, three.num_threads = 3;
  const SyncResult a = SynchronizeCameras(Prepare(take.rig), frames, {}, one);
  const SyncResult b = SynchronizeCameras(Prepare(take.rig), frames, {}, three);
  for (size_t c = 0; c < 3; ++c) EXPECT_EQ(a.cameras[c].offset_frames, b.cameras[c].offset_frames);
}

TEST(Sync, RefusesWrongOptions) {
  const Take take;
  SyncOptions options;
  options.reference = "nobody";
  EXPECT_THAT(testing::MessageOf<UsageError>([&] { SynchronizeCameras(Prepare(take.rig), {}, options); }),
              ::testing::HasSubstr("cam_0, cam_1"));
  options = {};
  options.max_offset_frames = 0;
  EXPECT_THROW(SynchronizeCameras(Prepare(take.rig), {}, options), UsageError);
}

}  // namespace
}  // namespace mvstudio::triangulate
