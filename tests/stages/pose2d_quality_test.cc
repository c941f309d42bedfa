#include "stages/people/pose2d_quality.h"

#include <cmath>

#include "core/units.h"
#include "tests/support/test.h"
#include "tests/triangulate/people.h"

namespace mvstudio::stages {
namespace {

using triangulate::Walker;

constexpr int kFrames = 12;
constexpr double kNoisePx = 0.01;

/// Pinhole cameras all around.
geometry::Rig Ring(int count) {
  geometry::Rig rig;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * kPi * i / count;
    rig.cameras.push_back(
        triangulate::LookAt("cam_" + std::to_string(i), {4 * std::cos(angle), 4 * std::sin(angle), 1.2 + 0.3 * i}, {0, 0, 1}));
  }
  return rig;
}

/// What each camera sees of a person who walks through the middle.
std::vector<dataset::Pose2dTrack> Walk(const geometry::Rig& rig) {
  Rng rng(11);
  std::vector<dataset::Pose2dTrack> tracks;
  for (const geometry::RigCamera& camera : rig.cameras) {
    dataset::Pose2dTrack track{camera.camera.name, {}};
    for (int f = 0; f < kFrames; ++f) {
      Walker walker;
      walker.position = {0.04 * f - 0.2, 0.1}, walker.phase = 0.4 * f, walker.heading = 0.3;
      dataset::Person2d person;
      for (const Eigen::Vector3d& x_in_world : triangulate::JointsOf(walker)) {
        const Eigen::Vector2d px = geometry::Project(camera.camera, camera.cam_from_world * x_in_world).px;
        person.keypoints.push_back({px.x() + kNoisePx * rng.Normal(), px.y() + kNoisePx * rng.Normal(), 0.9});
      }
      track.frames[f].push_back(person);
    }
    tracks.push_back(track);
  }
  return tracks;
}

const geometry::Skeleton& Body25() { return geometry::SkeletonByName("body25"); }

TEST(PoseQuality, DetectionsWithLittleNoiseAgreeAsFarAsTheirNoise) {
  const geometry::Rig rig = Ring(4);
  const PoseAgreement agreement = MeasureAgreement(Walk(rig), Body25(), rig, 1, {});
  EXPECT_EQ(agreement.share_ok, 1);
  EXPECT_NEAR(agreement.sigma_px, kNoisePx, 0.25 * kNoisePx);
  // The distance holds the left-out detection's own noise, whose median is 1.18 sigma, and that of the prediction.
  EXPECT_GT(agreement.median_px, 1.1 * kNoisePx);
  EXPECT_LT(agreement.median_px, 4 * kNoisePx);
  EXPECT_GE(agreement.p90_px, agreement.median_px);
  EXPECT_EQ(agreement.sides_fixed, 0);
  ASSERT_EQ(agreement.cameras.size(), 4u);
  EXPECT_EQ(agreement.cameras[2].name, "cam_2");
  ASSERT_EQ(agreement.joints.size(), 25u);
  EXPECT_EQ(agreement.joints[0].name, "Nose");
  EXPECT_EQ(agreement.joints[0].share_ok, 1);
  EXPECT_EQ(agreement.all.median_px, agreement.median_px);
}

TEST(PoseQuality, SwappedSidesOfOneCameraAreCountedAndMended) {
  const geometry::Rig rig = Ring(4);
  std::vector<dataset::Pose2dTrack> tracks = Walk(rig);
  const double median_px = MeasureAgreement(tracks, Body25(), rig, 1, {}).median_px;
  for (auto& [frame, people] : tracks[1].frames) {
    for (const auto& [left, right] : geometry::MirrorJoints(Body25()))
      std::swap(people[0].keypoints[left], people[0].keypoints[right]);
  }
  const PoseAgreement agreement = MeasureAgreement(tracks, Body25(), rig, 1, {});
  EXPECT_EQ(agreement.sides_fixed, kFrames);
  EXPECT_NEAR(agreement.median_px, median_px, 1e-12);
}

TEST(PoseQuality, TracksOfUnknownCamerasCountForNothing) {
  const geometry::Rig rig = Ring(3);
  std::vector<dataset::Pose2dTrack> tracks = Walk(rig);
  const PoseAgreement without = MeasureAgreement(tracks, Body25(), rig, 1, {});
  dataset::Pose2dTrack unknown = tracks[0];
  unknown.camera = "somebody's";
  tracks.push_back(unknown);
  const PoseAgreement with = MeasureAgreement(tracks, Body25(), rig, 1, {});
  EXPECT_TRUE(with.measured && without.measured);
  EXPECT_EQ(with.median_px, without.median_px);
  EXPECT_EQ(with.p90_px, without.p90_px);
  EXPECT_EQ(with.sigma_px, without.sigma_px);
  EXPECT_EQ(with.share_ok, without.share_ok);
  EXPECT_EQ(with.all.num_samples, without.all.num_samples);
  EXPECT_EQ(with.cameras.size(), without.cameras.size());
  tracks = {tracks[0], unknown};
  const PoseAgreement nothing = MeasureAgreement(tracks, Body25(), rig, 1, {});
  EXPECT_TRUE(std::isnan(nothing.median_px) && std::isnan(nothing.p90_px)) << "one camera has nothing to be compared with";
  EXPECT_FALSE(nothing.measured);
  EXPECT_EQ(nothing.share_ok, 0);
}

}  // namespace
}  // namespace mvstudio::stages
