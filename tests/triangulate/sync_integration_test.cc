#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "core/random.h"
#include "tests/triangulate/recordings.h"
#include "triangulate/sync/sync.h"

/// Recorded poses, shifted. The recordings were taken in step, so what was found without a shift counts as zero.
namespace mvstudio::triangulate {
namespace {

void Print(const char* what, const SyncResult& result) {
  std::printf("%s: %s, residual %.2f -> %.2f px, %d points\n", what, std::string(ToString(result.status)).c_str(),
              result.residual_before_px, result.residual_after_px, result.num_points);
  for (const CameraSync& c : result.cameras) {
    std::printf("  %-8s %-12s %8.3f +- %.3f coarse %d contrast %.2f agree %.2f runner-up %.0f ratio %.2f pairs %d/%d %s\n",
                c.name.c_str(), std::string(ToString(c.status)).c_str(), c.offset_frames, c.sigma_frames, c.coarse_frames,
                c.contrast, c.agreement, c.runner_up_frames, c.peak_ratio, c.num_pairs_disagree, c.num_pairs,
                c.message.c_str());
  }
}

/// Largest errors over the cameras: of the offset against the true one, and against the offset found without shifts plus it.
struct Errors {
  double frames = 0, relative_frames = 0;
};

/// `truth`: by camera, up to a common constant.
Errors Compare(const SyncResult& result, const SyncResult& unshifted, const std::vector<double>& truth) {
  Errors errors;
  const size_t r = static_cast<size_t>(result.reference_idx);
  for (size_t c = 0; c < truth.size(); ++c) {
    EXPECT_EQ(result.cameras[c].status, SyncStatus::kOk) << result.cameras[c].message;
    const double error = result.cameras[c].offset_frames - (truth[c] - truth[r]);
    const double before = unshifted.cameras[c].offset_frames - unshifted.cameras[r].offset_frames;
    errors.frames = std::max(errors.frames, std::abs(error));
    errors.relative_frames = std::max(errors.relative_frames, std::abs(error - before));
  }
  return errors;
}

Errors Worst(const Errors& a, const Errors& b) {
  return {std::max(a.frames, b.frames), std::max(a.relative_frames, b.relative_frames)};
}

/// All cameras shifted at random.
Errors ShiftAll(const Recording& recording, const SyncResult& unshifted, int range, int trials, bool fractions) {
  const PreparedRig rig = Prepare(recording.rig);
  Rng rng(5);
  Errors worst;
  for (int trial = 0; trial < trials; ++trial) {
    std::vector<int> add;
    std::vector<double> advance, truth;
    for (size_t c = 0; c < recording.rig.cameras.size(); ++c) {
      add.push_back(static_cast<int>(rng.Index(2 * range + 1)) - range);
      advance.push_back(fractions ? rng.Uniform(0.1, 0.9) : 0);
      truth.push_back(add.back() - advance.back());
    }
    const auto frames = Renumber(ApplyOffsets(recording.frames, advance), add);
    const SyncResult result = SynchronizeCameras(rig, frames, {});
    const Errors errors = Compare(result, unshifted, truth);
    if (::testing::Test::HasFailure()) {
      Print("failed", result);
      return errors;
    }
    worst = Worst(worst, errors);
  }
  return worst;
}

TEST(SyncBalancing, FindsShiftsOfAnyCamera) {
  MVS_NEEDS_DATA("pose2sim");
  const Recording recording = LoadPose2Sim("balancing");
  const PreparedRig rig = Prepare(recording.rig);
  const SyncResult unshifted = SynchronizeCameras(rig, recording.frames, {});
  Errors worst;
  for (size_t c = 0; c < 4; ++c) {
    for (const int shift : {-25, -2, 1, 13}) {
      std::vector<int> add(4, 0);
      add[c] = shift;
      const SyncResult result = SynchronizeCameras(rig, Renumber(recording.frames, add), {});
      worst = Worst(worst, Compare(result, unshifted, {add.begin(), add.end()}));
      if (std::abs(shift) > 1) {
        EXPECT_LE(result.residual_after_px, result.residual_before_px);
      }
    }
  }
  std::printf("one camera by -25 ... 25: %.3f frames, %.3f from unshifted\n", worst.frames, worst.relative_frames);
  EXPECT_LT(worst.frames, 0.5);
  worst = ShiftAll(recording, unshifted, 25, 6, false);
  std::printf("all cameras, whole: %.3f frames, %.3f from unshifted\n", worst.frames, worst.relative_frames);
  EXPECT_LT(worst.frames, 0.5);
  worst = ShiftAll(recording, unshifted, 25, 6, true);
  std::printf("all cameras, fractions: %.3f frames, %.3f from unshifted\n", worst.frames, worst.relative_frames);
  EXPECT_LT(worst.frames, 0.15);
  EXPECT_LT(worst.relative_frames, 0.1);
}

TEST(SyncBalancing, SeveralPeople) {
  MVS_NEEDS_DATA("pose2sim");
  const Recording recording = LoadPose2Sim("balancing", "pose");
  const SyncResult unshifted = SynchronizeCameras(Prepare(recording.rig), recording.frames, {});
  const Errors worst = ShiftAll(recording, unshifted, 25, 6, false);
  std::printf("all cameras, whole: %.3f frames, %.3f from unshifted\n", worst.frames, worst.relative_frames);
  EXPECT_LT(worst.frames, 0.5);
}

TEST(SyncStatic, SaysThatNothingMoves) {
  MVS_NEEDS_DATA("pose2sim");
  for (const char* poses : {"pose", "pose-associated"}) {
    const Recording recording = LoadPose2Sim("static", poses);
    for (const int shift : {0, 2}) {
      SyncOptions options;
      options.min_frames = 5;
      for (const SyncOptions& each : {SyncOptions{}, options}) {
        const SyncResult result =
            SynchronizeCameras(Prepare(recording.rig), Renumber(recording.frames, {0, shift, 0, 0}), each);
        EXPECT_NE(result.status, SyncStatus::kOk);
        for (const CameraSync& camera : result.cameras) EXPECT_NE(camera.status, SyncStatus::kOk);
      }
    }
  }
}

TEST(SyncPersonA, FindsShifts) {
  MVS_NEEDS_DATA("person_a");
  const Recording recording = LoadPersonA();
  const SyncResult unshifted = SynchronizeCameras(Prepare(recording.rig), recording.frames, {});
  Errors worst = ShiftAll(recording, unshifted, 25, 2, false);
  std::printf("all cameras, whole: %.3f frames, %.3f from unshifted\n", worst.frames, worst.relative_frames);
  EXPECT_LT(worst.frames, 0.5);
  worst = ShiftAll(recording, unshifted, 25, 2, true);
  std::printf("all cameras, fractions: %.3f frames, %.3f from unshifted\n", worst.frames, worst.relative_frames);
  EXPECT_LT(worst.frames, 0.1);
}

}  // namespace
}  // namespace mvstudio::triangulate
