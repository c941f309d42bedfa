#include "calib/points/point_clusters.h"

#include "calib/points/scene_adjustment.h"
#include "core/random.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

/// Features whose errors are shared by patches of the walls, and cameras whose lenses differ.
namespace mvstudio::calib {
namespace {

constexpr int kCameras = 6, kPatches = 24, kPerPatch = 15;

struct Truth {
  PointScene scene;
  std::vector<int> patch_of_point;
};

/// Cameras on an arc that look at patches of 0.3 m on two walls and the floor.
Truth MakeTruth(const std::vector<double>& focals) {
  Rng rng(3);
  Truth truth;
  for (int c = 0; c < kCameras; ++c) {
    geometry::Camera lens = GuessLens("cam" + std::to_string(c), 960, 720);
    lens.params.head<2>().setConstant(focals[static_cast<size_t>(c)]);
    truth.scene.lenses.push_back(lens);
    truth.scene.lens_of_camera.push_back(c);
    const double angle = 0.35 * (c - 2.5);
    truth.scene.cam_from_world.push_back(
        testing::LookAt({3 * std::sin(angle), -3 * std::cos(angle), 1.5 + 0.2 * (c % 2)}, {0, 0.5, 1}));
  }
  truth.scene.points.resize(3, kPatches * kPerPatch);
  for (int i = 0; i < kPatches * kPerPatch; ++i) {
    const int patch = i / kPerPatch;
    Rng of_patch(100 + static_cast<uint64_t>(patch));
    const double along = of_patch.Uniform(-1.5, 1.5), up = of_patch.Uniform(0, 2.2);
    const double da = rng.Uniform(-0.15, 0.15), db = rng.Uniform(-0.15, 0.15);
    Eigen::Vector3d x(along + da, 1.5, up + db);
    if (patch % 3 == 1) x = {along + da, up - 1.2 + db, 0};
    if (patch % 3 == 2) x = {along + da, 1 + 0.5 * along, up + db};
    truth.scene.points.col(i) = x;
    truth.patch_of_point.push_back(patch);
  }
  return truth;
}

/// Errors of `alone_px` of each feature and of `shared_px` of all features of a patch in a camera.
std::vector<PointObservation> ObserveTruth(const Truth& truth, double alone_px, double shared_px, uint64_t seed) {
  Rng rng(seed);
  std::vector<PointObservation> observations;
  for (int c = 0; c < kCameras; ++c) {
    Eigen::Matrix2Xd shared(2, kPatches);
    for (int p = 0; p < kPatches; ++p) shared.col(p) = shared_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
    for (int i = 0; i < truth.scene.points.cols(); ++i) {
      const Eigen::Vector3d x = truth.scene.points.col(i);
      const geometry::Projection p =
          geometry::Project(truth.scene.LensOf(c), truth.scene.cam_from_world[static_cast<size_t>(c)] * x);
      if (p.status != Status::kOk || !geometry::InImage(truth.scene.LensOf(c), p.px)) continue;
      const Eigen::Vector2d noise = alone_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
      observations.push_back({c, i, p.px + noise + shared.col(truth.patch_of_point[static_cast<size_t>(i)]), 1});
    }
  }
  return observations;
}

PointBundleOptions HeldByADistance(const Truth& truth) {
  PointBundleOptions options;
  options.fix_camera.assign(kCameras, false);
  options.fix_camera[0] = true;
  const auto centre = [&](size_t c) { return geometry::Inverse(truth.scene.cam_from_world[c]).translation; };
  options.distance = KnownDistance{0, 5, (centre(0) - centre(5)).norm(), 1e-3};
  options.reject_outliers = false;
  return options;
}

struct Scatter {
  double factor = 0;                ///< mean over the draws
  double chi2_plain = 0, chi2 = 0;  ///< mean squared Mahalanobis distance of the poses over their 6 unknowns
};

Scatter Draw(double alone_px, double shared_px) {
  const Truth truth = MakeTruth(std::vector<double>(kCameras, 700));
  constexpr int kDraws = 12;
  Scatter scatter;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    std::vector<PointObservation> observations = ObserveTruth(truth, alone_px, shared_px, seed);
    PointScene scene = truth.scene;
    const PointBundleOptions options = HeldByADistance(truth);
    const PointBundleReport report = SolvePointBundle(&scene, &observations, options);
    EXPECT_EQ(report.status, Status::kOk);
    const PointBundleCovariance plain = CovarianceOfPointBundle(scene, observations, options, report.sigma_px);
    const ClusterInflation inflation = InflationByClusters(scene, observations, options, report.sigma_px);
    scatter.factor += inflation.factor / kDraws;
    for (size_t c = 1; c < kCameras; ++c) {
      geometry::Vector6d delta;
      delta.head<3>() =
          geometry::RotationLog(scene.cam_from_world[c].rotation * truth.scene.cam_from_world[c].rotation.conjugate());
      delta.tail<3>() = scene.cam_from_world[c].translation - truth.scene.cam_from_world[c].translation;
      const double chi2 = delta.dot(plain.cam_from_world[c].ldlt().solve(delta)) / 6 / kDraws / (kCameras - 1);
      scatter.chi2_plain += chi2, scatter.chi2 += chi2 / inflation.factor;
    }
  }
  return scatter;
}

TEST(InflationByClusters, IndependentErrorsNeedNone) {
  const Scatter scatter = Draw(0.3, 0);
  EXPECT_LT(scatter.factor, 1.5);
  EXPECT_GT(scatter.chi2, 0.5);
  EXPECT_LT(scatter.chi2, 1.5);
}

TEST(InflationByClusters, SharedErrorsAreFoundAndTheCovarianceIsHonest) {
  const Scatter scatter = Draw(0.2, 0.25);
  EXPECT_GT(scatter.chi2_plain, 2.5) << "the test shows nothing";
  EXPECT_GT(scatter.factor, 2.5);
  EXPECT_GT(scatter.chi2, 0.5);
  EXPECT_LT(scatter.chi2, 2);
}

TEST(InflationByClusters, TooFewPointsSayNothing) {
  const Truth truth = MakeTruth(std::vector<double>(kCameras, 700));
  std::vector<PointObservation> observations = ObserveTruth(truth, 0.2, 0, 1);
  for (PointObservation& o : observations) o.weight = 0;
  EXPECT_EQ(InflationByClusters(truth.scene, observations, HeldByADistance(truth), 1).factor, 1);
}

/// One lens for all is kept where it is true, given up where it is not.
TEST(OwnLensesPay, OnlyWhereTheLensesDiffer) {
  for (const bool differ : {false, true}) {
    std::vector<double> focals(kCameras, 700);
    if (differ) focals = {690, 707, 701, 695, 712, 699};
    const Truth truth = MakeTruth(focals);
    ColmapScene scene;
    std::vector<SceneImage> images;
    for (int c = 0; c < kCameras; ++c) {
      geometry::RigCamera camera;
      camera.camera = truth.scene.lenses[static_cast<size_t>(c)];
      camera.camera.params.head<2>().setConstant(700);
      camera.cam_from_world = truth.scene.cam_from_world[static_cast<size_t>(c)];
      scene.rig.cameras.push_back(camera);
      images.push_back({camera.camera.name, "", camera.camera, false});
    }
    scene.points = truth.scene.points;
    for (const PointObservation& o : ObserveTruth(truth, 0.1, 0, 2)) scene.tracks.push_back({o.camera_idx, o.point_idx, o.px});
    EXPECT_EQ(OwnLensesPay(scene, images, {}, 0.2, 2), differ);
    SceneScale scale;
    const auto centre = [&](size_t c) { return geometry::Inverse(truth.scene.cam_from_world[c]).translation; };
    scale.distance = SceneScale::Distance{"cam0", "cam5", (centre(0) - centre(5)).norm(), 0};
    const FromSceneReport report = AdjustScene(scene, images, scale, {}, {});
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_EQ(report.own_lenses, differ);
    for (size_t c = 0; c < kCameras; ++c) {
      const double sigma = std::sqrt((*report.rig.cameras[c].params_covariance)(0, 0));
      EXPECT_NEAR(report.rig.cameras[c].camera.fx(), focals[c], 4 * sigma) << c;
      EXPECT_LT(sigma, 3) << c;
    }
  }
}

}  // namespace
}  // namespace mvstudio::calib
