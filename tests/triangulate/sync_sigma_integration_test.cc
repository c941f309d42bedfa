#include <gtest/gtest.h>

#include <cmath>

#include "tests/triangulate/support.h"
#include "triangulate/budget/reliability.h"
#include "triangulate/sync/joint_tracks.h"
#include "triangulate/sync/offset_sigma.h"
#include "triangulate/sync/refine_offsets.h"

/// Whether offsets err as their sigmas say, over many takes of slow motion, few cameras and short tracks.
namespace mvstudio::triangulate {
namespace {

constexpr int kSlowJoints = 12;

Eigen::Vector3d SlowJointAt(int joint, double frame) {
  const double t = 0.3 * frame / 30, phase = 0.7 * joint;
  return Eigen::Vector3d(0.3 * std::cos(2.4 * joint), 0.3 * std::sin(2.4 * joint), 0.12 * joint - 0.7) +
         0.2 * Eigen::Vector3d(std::sin(2.1 * t + phase) + 0.5 * std::sin(5.3 * t), std::sin(1.3 * t - phase),
                               0.6 * std::sin(3.7 * t + 2 * phase) + 0.3 * std::cos(0.9 * t));
}

struct SlowTake {
  int cameras = 3, frames = 60;
  double noise_px = 1, wander = 0;  // correlation of the noise of neighbouring frames
  std::vector<double> offsets;
  uint64_t seed = 0;
};

std::vector<DetectedFrame> FilmSlowly(const SlowTake& take, const geometry::Rig& rig) {
  Rng rng(take.seed);
  const double start = rng.Uniform(0, 1000);
  std::vector<std::vector<Eigen::Vector2d>> noise(rig.cameras.size(), std::vector<Eigen::Vector2d>(kSlowJoints));
  for (auto& camera : noise) {
    for (Eigen::Vector2d& each : camera) each = {rng.Normal(), rng.Normal()};
  }
  std::vector<DetectedFrame> frames;
  for (int f = 0; f < take.frames; ++f) {
    DetectedFrame& frame = frames.emplace_back();
    frame.frame = f;
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      DetectedPerson person;
      for (int j = 0; j < kSlowJoints; ++j) {
        Eigen::Vector2d& own = noise[c][static_cast<size_t>(j)];
        own = take.wander * own + std::sqrt(1 - take.wander * take.wander) * Eigen::Vector2d(rng.Normal(), rng.Normal());
        const geometry::RigCamera& camera = rig.cameras[c];
        const Eigen::Vector3d x = SlowJointAt(j, start + f - take.offsets[c]);
        person.push_back({geometry::Project(camera.camera, camera.cam_from_world * x).px + take.noise_px * own, 0.9});
      }
      frame.people.push_back({person});
    }
  }
  return frames;
}

/// Squared errors of the offsets over their sigmas, over many takes. Every other take has whole offsets.
std::vector<double> WhitenedSlowOffsets(SlowTake take, int num_takes) {
  const geometry::Rig rig = MakeRing(take.cameras);
  const PreparedRig prepared = Prepare(rig);
  std::vector<double> squared;
  for (int k = 0; k < num_takes; ++k) {
    Rng rng(1000 + static_cast<uint64_t>(k));
    take.seed = static_cast<uint64_t>(k);
    take.offsets.assign(static_cast<size_t>(take.cameras), 0);
    std::vector<std::optional<int>> whole(take.offsets.size(), 0);
    for (size_t c = 1; c < take.offsets.size(); ++c) {
      const double offset = rng.Uniform(-4, 4);
      whole[c] = static_cast<int>(std::lround(offset));
      take.offsets[c] = k % 2 ? *whole[c] : offset;
    }
    const internal::FineSync fine = internal::RefineOffsets(prepared, FilmSlowly(take, rig), whole, 0, 1, {}, {});
    if (!fine.ok) continue;
    for (size_t c = 1; c < take.offsets.size(); ++c)
      squared.push_back(std::pow((fine.offset_frames[c] - take.offsets[c]) / fine.sigma_frames[c], 2));
  }
  return squared;
}

void ExpectTrue(const char* what, const std::vector<double>& squared, size_t least, double most_error) {
  const Reliability is = MeasureReliability(squared, 1);
  std::printf("%s: %d offsets, calibration error %.3f (by chance %.3f), sigmas should grow by %.2f\n", what, is.num, is.error,
              is.chance, is.sigma_factor);
  EXPECT_GE(squared.size(), least) << what;
  EXPECT_LT(is.error, most_error) << what;
  EXPECT_GT(is.sigma_factor, 0.7) << what;
  EXPECT_LT(is.sigma_factor, 1.4) << what;
}

/// Slopes are mostly noise here: it passed as motion, and the sigmas were too small by two to three.
TEST(SyncSigma, OfSlowMotionIsTrue) {
  SlowTake take;
  take.noise_px = 3;
  ExpectTrue("slow", WhitenedSlowOffsets(take, 30), 55, 0.13);
}

/// Two views leave one of four residuals to a point: their size says half of the noise.
TEST(SyncSigma, OfTwoCamerasIsTrue) {
  SlowTake take;
  take.cameras = 2;
  ExpectTrue("two cameras", WhitenedSlowOffsets(take, 60), 55, 0.12);
}

/// Detectors err alike in neighbouring frames.
TEST(SyncSigma, OfWanderingDetectionsIsTrue) {
  SlowTake take;
  take.cameras = 5, take.frames = 120, take.wander = 0.8;
  ExpectTrue("wandering", WhitenedSlowOffsets(take, 20), 75, 0.1);
}

/// One camera's noise is known: so are the noise of a sample, of a slope and how far samples share theirs.
TEST(SyncSigma, NoiseOfTracksIsThatOfTheFilter) {
  SlowTake take;
  take.cameras = 4, take.frames = 120, take.offsets = {0, 0.3, -0.4, 0.1};
  const geometry::Rig rig = MakeRing(take.cameras);
  const PreparedRig prepared = Prepare(rig);
  // Variances of the local quadratic fit of SampleTrack by noise of variance 1: rows of (B^T W B)^-1 B^T W, squared.
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero(), squares = Eigen::Matrix3d::Zero();
  for (int t = -4; t <= 4; ++t) {
    const double weight = std::pow(1 - t * t / 20.25, 3);
    const Eigen::Vector3d basis(1, t, t * t);
    moments += weight * basis * basis.transpose(), squares += weight * weight * basis * basis.transpose();
  }
  const Eigen::Matrix3d variance = moments.inverse() * squares * moments.inverse();
  std::vector<int> frames;
  const std::vector<std::optional<int>> whole(4, 0);
  const internal::Tracks tracks = internal::MakeTracks(prepared, FilmSlowly(take, rig), whole, 0.3, {}, &frames);
  std::vector<internal::TimedPoint> points;
  for (const int f : frames) {
    for (size_t j = 0; j < kSlowJoints; ++j) {
      internal::TimedPoint point;
      point.frame = point.index = f, point.joint_idx = j;
      std::vector<Observation> seen;
      for (size_t c = 0; c < 4; ++c) {
        if (!internal::HasNeighbours(tracks[c][0][j], f)) continue;
        const auto sample = internal::SampleTrack(tracks[c][0][j], f + take.offsets[c]);
        ASSERT_TRUE(sample);
        Status status;
        const std::vector<View> views = MakeViews(prepared, {{static_cast<int>(c), sample->px, 1.0, 1.0}}, &status);
        point.views.push_back({views[0], c, sample->px_per_frame});
        seen.push_back({static_cast<int>(c), sample->px, 1.0, 1.0});
      }
      if (seen.size() < 4) continue;
      point.x_in_local = TriangulatePoint(prepared, seen, {}).x_in_world - prepared.origin_in_world;
      points.push_back(point);
    }
  }
  ASSERT_GT(points.size(), 1000u);
  const internal::ClockVariances found =
      internal::MeasureClockVariances(prepared, points, Eigen::MatrixXd::Identity(16, 16) * 1e9, {});
  EXPECT_NEAR(found.noise.sigma_px, std::sqrt(variance(0, 0)), 0.06);
  EXPECT_NEAR(found.noise.sigma_px_per_frame, std::sqrt(variance(1, 1)), 0.02);
  EXPECT_EQ(found.noise.correlation[0], 1);
  double sum = 1;
  for (size_t k = 1; k < found.noise.correlation.size(); ++k) sum += 2 * found.noise.correlation[k];
  EXPECT_NEAR(sum, 1 / variance(0, 0), 0.6);  // smoothing keeps slow noise
}

}  // namespace
}  // namespace mvstudio::triangulate
