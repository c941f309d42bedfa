#include "calib/keypoints/refine.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/keypoint_support.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using triangulate::DetectedFrame;

/// Six cameras a metre from a volume of a quarter of a metre. The given lenses are wrong, and its poses make up for that as far
/// as poses can: what the lenses ask for then lies below a pixel.
struct SmallVolume {
  geometry::Rig truth, given;
  std::vector<DetectedFrame> frames;
  Eigen::Matrix3Xd points;  // (3, N) in world, metres
  std::vector<KeypointJoint> joints;

  SmallVolume(uint64_t seed, double noise_px, int points_per_frame) : rng_(seed) {
    truth = testing::PeopleRig(6);
    for (geometry::RigCamera& camera : truth.cameras) {
      camera.camera.params.head<2>() *= 1400.0 / 900, camera.cam_from_world.translation /= 4;
      camera.camera.params.tail<2>() << -0.1, 0.05;
    }
    given = truth;
    for (geometry::RigCamera& camera : given.cameras) {
      camera.camera.params.head<2>() *= 1 + 0.01 * rng_.Normal();
      camera.camera.params[1] *= 1 + 0.003 * rng_.Normal();
      camera.camera.params.segment<2>(2) += 8 * Eigen::Vector2d(rng_.Normal(), rng_.Normal());
      camera.camera.params[4] += 0.05 * rng_.Normal();
    }
    Film(0.001, 1);
    given = AlignToGiven(SolveKeypoints(given, joints, {}, 0, 1).rig, given);
    Film(noise_px, points_per_frame);
  }

  /// Median distance of the points from the truth after a similarity, mm: what the rig does to space.
  double ErrorMm(const geometry::Rig& rig) const {
    Eigen::Matrix3Xd found = points;
    for (const KeypointFit& fit : FitKeypoints(rig, joints, 1, 2, 1))
      found.col(static_cast<Eigen::Index>(fit.joint - joints.data())) = fit.x_in_world;
    const geometry::Alignment to = geometry::AlignPoints(found, points, true);
    std::vector<double> off;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      const Eigen::Vector3d x = to.scale * (to.b_from_a.rotation * found.col(i)) + to.b_from_a.translation;
      off.push_back(1e3 * (x - points.col(i)).norm());
    }
    std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2), off.end());
    return off[off.size() / 2];
  }

 private:
  /// Points that keep no distance from each other.
  void Film(double noise_px, int points_per_frame) {
    constexpr int kFrames = 80;
    frames.clear(), joints.clear();
    points = Eigen::Matrix3Xd::NullaryExpr(3, kFrames * points_per_frame, [&] { return rng_.Uniform(-0.12, 0.12); });
    for (int f = 0; f < kFrames; ++f) {
      DetectedFrame frame{f, std::vector<std::vector<triangulate::DetectedPerson>>(truth.cameras.size())};
      for (int j = 0; j < points_per_frame; ++j) joints.push_back({f, 0, j, {}});
      for (size_t c = 0; c < truth.cameras.size(); ++c) {
        triangulate::DetectedPerson& person = frame.people[c].emplace_back();
        for (int j = 0; j < points_per_frame; ++j) {
          const Eigen::Vector3d x = points.col(f * points_per_frame + j);
          const Eigen::Vector2d noise(rng_.Normal(), rng_.Normal());
          const Eigen::Vector2d px =
              geometry::Project(truth.cameras[c].camera, truth.cameras[c].cam_from_world * x).px + noise_px * noise;
          person.push_back({px, 0.9});
          joints[static_cast<size_t>(f * points_per_frame + j)].seen.push_back({static_cast<int>(c), px, 1, 1});
        }
      }
      frames.push_back(std::move(frame));
    }
  }

  Rng rng_;
};

/// Held-out pixels of the volume fall to a fifth and the points lie three times as far from the truth, where lens terms are
/// freed by those pixels.
TEST(KeypointSmallVolume, FreedLensesNeverMakeThePointsWorse) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SmallVolume scene(seed, 0.02, 1);
    KeypointRefineOptions options;
    options.choice.num_folds = 3;
    const KeypointRefineReport report = RefineFromKeypoints(scene.given, scene.frames, {}, {}, {}, options);
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    const double before = scene.ErrorMm(scene.given), after = scene.ErrorMm(report.rig);
    EXPECT_LT(after, 1.1 * before) << seed << ": " << report.before.median_px << " -> " << report.after.median_px << " px";
  }
}

}  // namespace
}  // namespace mvstudio::calib
