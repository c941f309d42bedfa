#include "calib/points/point_bundle.h"

#include <cmath>

#include "calib/points/from_scene.h"
#include "calib/points/point_problem.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

struct World {
  PointScene scene;  // truth
  std::vector<PointObservation> observations;
};

/// Cameras around a cloud of points.
World MakeWorld(int num_cameras, int num_points, double noise_px, uint64_t seed) {
  World world;
  Rng rng(seed);
  world.scene.points = Eigen::Matrix3Xd::NullaryExpr(3, num_points, [&] { return rng.Uniform(-0.8, 0.8); });
  for (int c = 0; c < num_cameras; ++c) {
    geometry::Camera lens = testing::MakeCamera("cam" + std::to_string(c), LensModel::kBrown2, 500);
    world.scene.lenses.push_back(lens);
    world.scene.lens_of_camera.push_back(c);
    const double angle = 0.7 * c;
    world.scene.cam_from_world.push_back(
        testing::LookAt({3 * std::sin(angle), -3 * std::cos(angle), 0.3 * c - 0.5}, Eigen::Vector3d::Zero()));
    for (int p = 0; p < num_points; ++p) {
      const auto projection =
          geometry::Project(lens, world.scene.cam_from_world[c] * Eigen::Vector3d(world.scene.points.col(p)));
      if (projection.status != Status::kOk || !geometry::InImage(lens, projection.px)) continue;
      world.observations.push_back({c, p, projection.px + noise_px * Eigen::Vector2d(rng.Normal(), rng.Normal()), 1});
    }
  }
  return world;
}

/// A start that is off by degrees and centimetres.
PointScene DisturbedScene(const PointScene& truth, uint64_t seed, bool keep_first) {
  PointScene scene = truth;
  Rng rng(seed);
  for (size_t c = keep_first ? 1 : 0; c < scene.cam_from_world.size(); ++c) {
    geometry::Vector6d delta;
    for (int i = 0; i < 6; ++i) delta[i] = 0.02 * rng.Normal();
    scene.cam_from_world[c] = geometry::Perturb(delta, scene.cam_from_world[c]);
  }
  for (Eigen::Index i = 0; i < scene.points.cols(); ++i)
    scene.points.col(i) += 0.03 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
  return scene;
}

PointBundleOptions HeldByDistance(const PointScene& truth) {
  PointBundleOptions options;
  options.fix_camera.assign(truth.cam_from_world.size(), false);
  options.fix_camera[0] = true;
  const auto centre = [&](int c) { return geometry::Inverse(truth.cam_from_world[c]).translation; };
  options.distance = KnownDistance{0, 2, (centre(0) - centre(2)).norm(), 0};
  for (const geometry::Camera& lens : truth.lenses) options.lens_directions.push_back(FocalDirections(lens, 2));
  return options;
}

TEST(PointBundle, RecoversExactly) {
  World world = MakeWorld(4, 60, 0, 1);
  PointBundleOptions options = HeldByDistance(world.scene);
  options.cost_tolerance = 1e-14;
  PointScene scene = DisturbedScene(world.scene, 2, true);
  for (geometry::Camera& lens : scene.lenses) lens.params[0] *= 1.02, lens.params[1] *= 1.02;
  const PointBundleReport report = SolvePointBundle(&scene, &world.observations, options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT(report.rms_px, 1e-6);
  EXPECT_EQ(report.num_rejected, 0);
  EXPECT_LT((scene.points - world.scene.points).cwiseAbs().maxCoeff(), 1e-5);
  for (int c = 0; c < 4; ++c) EXPECT_LT((scene.lenses[c].params - world.scene.lenses[c].params).cwiseAbs().maxCoeff(), 1e-3);
}

TEST(PointBundle, BothEliminationsGiveTheSameEquations) {
  const World world = MakeWorld(3, 12, 0.5, 3);
  PointBundleOptions options = HeldByDistance(world.scene);
  options.distance.reset();
  std::vector<double> costs;
  for (const auto blocks : {PointProblem::Blocks::kPoints, PointProblem::Blocks::kCameras}) {
    PointProblem problem(DisturbedScene(world.scene, 4, true), world.observations, options, blocks, 0);
    SchurSystem system;
    problem.AllocateSystem(&system);
    SchurLmOptions lm;
    lm.cost_tolerance = 1e-14;
    EXPECT_EQ(SolveSchurLm(&problem, &system, lm).status, Status::kOk);
    costs.push_back(system.cost);
  }
  EXPECT_NEAR(costs[0], costs[1], 1e-7 * costs[0]);
}

/// The gradient is half the derivative of the cost, for every global unknown and block, robust or not.
TEST(PointBundle, GradientIsTheCostsDerivative) {
  const World world = MakeWorld(3, 10, 2, 5);
  PointBundleOptions options = HeldByDistance(world.scene);
  options.distance->distance *= 1.01;
  options.distance->sigma = 0.05;
  for (const double robust : {0.0, 3.0}) {
    PointProblem problem(world.scene, world.observations, options, PointProblem::Blocks::kPoints, robust);
    SchurSystem system;
    problem.AllocateSystem(&system);
    const Eigen::Index n = system.g.size();
    const auto cost = [&](const Eigen::VectorXd& global, const Eigen::MatrixXd& blocks) {
      problem.Try(global, blocks);
      EXPECT_TRUE(problem.LinearizeTrial(&system));
      return system.cost;
    };
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(n);
    const Eigen::MatrixXd still = Eigen::MatrixXd::Zero(3, system.num_blocks());
    cost(zero, still);
    const Eigen::VectorXd g = system.g;
    const Eigen::MatrixXd block_g = system.block_g;
    constexpr double kStep = 1e-6;
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(n, i);
      const double numeric = (cost(step, still) - cost(-step, still)) / (4 * kStep);
      EXPECT_NEAR(g[i], numeric, 1e-4 * (1 + std::abs(numeric))) << i;
    }
    Eigen::MatrixXd step = still;
    step(1, 4) = kStep;
    EXPECT_NEAR(block_g(1, 4), (cost(zero, step) - cost(zero, -step)) / (4 * kStep), 1e-4 * std::abs(block_g(1, 4)) + 1e-4);
  }
}

TEST(PointBundle, GrossErrorsAreRejected) {
  World world = MakeWorld(5, 80, 0.5, 6);
  Rng rng(1);
  std::vector<size_t> wrong;
  for (size_t i = 3; i < world.observations.size(); i += 10) {
    world.observations[i].px += Eigen::Vector2d(rng.Uniform(20, 80), rng.Uniform(-80, -20));
    wrong.push_back(i);
  }
  PointScene scene = DisturbedScene(world.scene, 7, true);
  const PointBundleReport report = SolvePointBundle(&scene, &world.observations, HeldByDistance(world.scene));
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  for (const size_t i : wrong) EXPECT_EQ(world.observations[i].weight, 0) << i;
  EXPECT_LE(report.num_rejected, static_cast<int>(wrong.size()) + 3);
  EXPECT_NEAR(report.sigma_px, 0.5, 0.05);
}

/// Squared Mahalanobis distance of all free poses at once: its mean is their number, over draws.
TEST(PointBundle, CovarianceIsHonest) {
  constexpr int kDraws = 60;
  double sum = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    World world = MakeWorld(3, 40, 0.5, 100 + draw);
    PointBundleOptions options = HeldByDistance(world.scene);
    options.reject_outliers = false;
    PointScene scene = world.scene;
    ASSERT_EQ(SolvePointBundle(&scene, &world.observations, options).status, Status::kOk);
    const PointBundleCovariance covariance = CovarianceOfPointBundle(scene, world.observations, options, 0.5);
    ASSERT_EQ(covariance.status, Status::kOk) << covariance.message;
    const geometry::Rigid3 &found = scene.cam_from_world[1], &truth = world.scene.cam_from_world[1];
    geometry::Vector6d delta;
    delta.head<3>() = geometry::RotationLog(found.rotation * truth.rotation.conjugate());
    delta.tail<3>() = found.translation - truth.translation;
    sum += delta.dot(covariance.cam_from_world[1].ldlt().solve(delta));
    EXPECT_TRUE(covariance.cam_from_world[0].isZero(0));
    EXPECT_GT(covariance.lens[1](0, 0), 0);
  }
  // The mean of 60 chi-squared numbers with 6 degrees of freedom has a standard deviation of 0.45.
  EXPECT_NEAR(sum / kDraws, 6, 3 * 0.45);
}

TEST(PointBundle, FreeScaleIsNamed) {
  World world = MakeWorld(3, 40, 0.5, 9);
  PointBundleOptions options = HeldByDistance(world.scene);
  options.distance.reset();
  EXPECT_EQ(CovarianceOfPointBundle(world.scene, world.observations, options, 1).status, Status::kDegenerate);
}

TEST(PointBundle, BadInputs) {
  World world = MakeWorld(3, 40, 0.5, 9);
  PointScene scene = world.scene;
  std::vector<PointObservation> few(world.observations.begin(), world.observations.begin() + 10);
  EXPECT_EQ(SolvePointBundle(&scene, &few, HeldByDistance(scene)).status, Status::kTooFewViews);
  scene.points(0, 0) = NAN;
  EXPECT_EQ(SolvePointBundle(&scene, &world.observations, HeldByDistance(world.scene)).status, Status::kNonFiniteInput);
}

/// A model as colmap gives it: the truth in another frame and unit, with noisy features.
struct Model {
  World world;
  ColmapScene scene;
  std::vector<SceneImage> images;
};

Model MakeModel(double noise_px) {
  Model model{MakeWorld(4, 80, noise_px, 12), {}, {}};
  geometry::Rigid3 world_from_scene;
  world_from_scene.rotation = geometry::RotationExp({0.4, 1.1, -0.3});
  world_from_scene.translation << 1, -2, 0.5;
  constexpr double kScale = 0.37;  // metres per unit
  const geometry::Rigid3 scene_from_world = geometry::Inverse(world_from_scene);
  for (int c = 0; c < 4; ++c) {
    geometry::RigCamera camera;
    camera.camera = model.world.scene.lenses[c];
    camera.cam_from_world = model.world.scene.cam_from_world[c] * world_from_scene;
    camera.cam_from_world.translation /= kScale;
    model.scene.rig.cameras.push_back(camera);
    model.images.push_back({camera.camera.name, "", camera.camera, true});
  }
  model.images.push_back({"blind", "", model.images[0].lens, true});
  model.scene.points =
      ((scene_from_world.rotation.toRotationMatrix() * model.world.scene.points).colwise() + scene_from_world.translation) /
      kScale;
  for (const PointObservation& o : model.world.observations) model.scene.tracks.push_back({o.camera_idx, o.point_idx, o.px});
  return model;
}

TEST(AdjustScene, MarkedPointsGivePlaceAndScale) {
  const Model model = MakeModel(0.3);
  KnownPoints known;
  known.gauge.kind = geometry::RigGauge::Kind::kPoints;
  known.x_in_world.resize(3, 6);
  Rng rng(4);
  for (int i = 0; i < 6; ++i) {
    known.names.push_back("mark" + std::to_string(i));
    known.x_in_world.col(i) << rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5), rng.Uniform(-0.4, 0.4);
    for (int c = 0; c < 4; ++c) {
      const auto p = geometry::Project(model.images[c].lens,
                                       model.world.scene.cam_from_world[c] * Eigen::Vector3d(known.x_in_world.col(i)));
      ASSERT_EQ(p.status, Status::kOk);
      known.clicks.push_back({model.images[c].camera, i, p.px + 0.5 * Eigen::Vector2d(rng.Normal(), rng.Normal())});
    }
  }
  known.clicks[5].px.x() += 40;
  SceneScale scale;
  scale.points = known;
  const FromSceneReport report = AdjustScene(model.scene, model.images, scale, {}, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_EQ(report.missing, (std::vector<std::string>{"blind"}));
  ASSERT_EQ(report.gross.size(), 1u);
  EXPECT_EQ(report.gross[0].substr(0, 13), "mark1 in cam1");
  for (int c = 0; c < 4; ++c) {
    const geometry::Rigid3 &found = report.rig.cameras[c].cam_from_world, &truth = model.world.scene.cam_from_world[c];
    ASSERT_TRUE(report.rig.cameras[c].cam_from_world_covariance.has_value());
    geometry::Vector6d delta;
    delta.head<3>() = geometry::RotationLog(found.rotation * truth.rotation.conjugate());
    delta.tail<3>() = found.translation - truth.translation;
    EXPECT_LT(delta.dot(report.rig.cameras[c].cam_from_world_covariance->ldlt().solve(delta)), 30)
        << c;  // by chance 1 in 25000
    EXPECT_LT(delta.norm(), 0.03) << c;
  }
}

TEST(AdjustScene, CameraDistanceGivesScale) {
  const Model model = MakeModel(0.3);
  SceneScale scale;
  const auto centre = [&](int c) { return geometry::Inverse(model.world.scene.cam_from_world[c]).translation; };
  scale.distance = SceneScale::Distance{"cam0", "cam3", (centre(0) - centre(3)).norm(), 0};
  const FromSceneReport report = AdjustScene(model.scene, model.images, scale, {}, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_TRUE(report.rig.cameras[0].cam_from_world.translation.isZero(1e-9));
  for (int c = 1; c < 4; ++c) {
    const geometry::Rigid3 truth = model.world.scene.cam_from_world[c] * geometry::Inverse(model.world.scene.cam_from_world[0]);
    EXPECT_LT((report.rig.cameras[c].CenterInWorld() - geometry::Inverse(truth).translation).norm(), 0.008);
  }
}

TEST(AdjustScene, ReasonsForRefusal) {
  const Model model = MakeModel(0);
  SceneScale scale;
  EXPECT_NE(mvstudio::testing::MessageOf<UsageError>([&] {
              AdjustScene(model.scene, model.images, scale, {}, {});
            }).find("option 'camera-distance'"),
            std::string::npos);
  scale.distance = SceneScale::Distance{"cam0", "blind", 1, 0};
  EXPECT_EQ(AdjustScene(model.scene, model.images, scale, {}, {}).status, Status::kTooFewViews);
  scale.points = KnownPoints{{"a"}, Eigen::Matrix3Xd::Zero(3, 1), {{"cam0", 0, {10, 10}}}, 1, {}};
  EXPECT_EQ(AdjustScene(model.scene, model.images, scale, {}, {}).status, Status::kTooFewViews);
}

TEST(ParseCameraDistance, Forms) {
  const SceneScale::Distance d = ParseCameraDistance("left:right:123.4cm");
  EXPECT_EQ(d.a, "left");
  EXPECT_EQ(d.b, "right");
  EXPECT_NEAR(d.distance_m, 1.234, 1e-12);
  for (const char* bad : {"left:right", "left:right:1", "left:left:1m", "left:right:-1m", "l:r:xm", ":r:1m"})
    EXPECT_THROW(ParseCameraDistance(bad), UsageError) << bad;
}

}  // namespace
}  // namespace mvstudio::calib
