#include "calib/points/scene_carry.h"

#include "calib/points/point_bundle.h"
#include "calib/points/scene_points.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Cameras around a cloud of marks that all of them see, without noise.
struct Room {
  geometry::Rig rig;
  ScenePoints marks;
};

Room MakeRoom() {
  Room room;
  Rng rng(3);
  room.rig = testing::TruthRig(testing::MakeScene({}));
  room.marks.x_in_world.resize(3, 14);
  for (int i = 0; i < 14; ++i) {
    room.marks.names.push_back("mark" + std::to_string(i));
    room.marks.x_in_world.col(i) << rng.Uniform(-0.4, 0.4), rng.Uniform(-0.3, 0.3), rng.Uniform(0.9, 1.5);
  }
  for (size_t c = 0; c < room.rig.cameras.size(); ++c) {
    const geometry::RigCamera& camera = room.rig.cameras[c];
    room.marks.cameras.push_back(camera.camera.name);
    for (int i = 0; i < 14; ++i) {
      const Eigen::Vector3d x = room.marks.x_in_world.col(i);
      const geometry::Projection seen = geometry::Project(camera.camera, camera.cam_from_world * x);
      if (seen.status == Status::kOk) room.marks.clicks.push_back({static_cast<int>(c), i, seen.px});
    }
  }
  return room;
}

geometry::Rig Given(const geometry::Rig& rig, double scale) {
  geometry::Rig given = rig;
  geometry::StatedCovariance stated = geometry::StatedCovarianceOf(rig);
  Rng rng(9);
  const Eigen::Index n = stated.joint.rows();
  Eigen::MatrixXd root(n, n);
  for (Eigen::Index i = 0; i < root.size(); ++i) root.data()[i] = scale * rng.Normal();
  for (size_t c = 0; c < rig.cameras.size(); ++c) root.middleRows<6>(stated.PoseRow(c)) *= 1e-3;
  stated.joint = root * root.transpose(), stated.correlated = true;
  stated.lens_known.assign(rig.cameras.size(), true), stated.pose_known = stated.lens_known;
  geometry::StoreCovariance(stated, &given);
  return given;
}

geometry::Rig Shifted(const geometry::Rig& rig, Eigen::Index row, double step) {
  geometry::Rig shifted = rig;
  Eigen::Index begin = 0;
  for (geometry::RigCamera& camera : shifted.cameras) {
    const Eigen::Index p = camera.camera.params.size(), at = row - begin;
    if (at >= 0 && at < p) camera.camera.params[at] += step;
    if (at >= p && at < p + 6)
      camera.cam_from_world =
          geometry::Perturb(geometry::Vector6d(step * geometry::Vector6d::Unit(at - p)), camera.cam_from_world);
    begin += p + 6;
  }
  return shifted;
}

/// `a` minus `b` in the layout of the joint covariance.
Eigen::VectorXd Difference(const geometry::Rig& a, const geometry::Rig& b) {
  Eigen::VectorXd all(0);
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    const geometry::Rigid3 &x = a.cameras[c].cam_from_world, &y = b.cameras[c].cam_from_world;
    const Eigen::Index n = all.size(), p = a.cameras[c].camera.params.size();
    all.conservativeResize(n + p + 6);
    all.segment(n, p) = a.cameras[c].camera.params - b.cameras[c].camera.params;
    all.segment<3>(n + p) = geometry::RotationLog((x.rotation * y.rotation.conjugate()).normalized());
    all.segment<3>(n + p + 3) = x.translation - y.translation;
  }
  return all;
}

/// What the given errors add is what shifting the given calibration does, for lone cameras and for a group.
TEST(PlacedCovariance, FollowsTheGivenCalibration) {
  const Room room = MakeRoom();
  const geometry::Rig given = Given(room.rig, 1e-3), exact = Given(room.rig, 0);
  for (const bool rigid : {false, true}) {
    SCOPED_TRACE(rigid ? "group" : "alone");
    const auto place = [&](const geometry::Rig& rig) { return ResectScene(room.marks, rig, rigid, {}).rig; };
    const geometry::Rig placed = place(given), own = place(exact);
    ASSERT_EQ(placed.cameras.size(), given.cameras.size());
    ASSERT_TRUE(geometry::HasJointCovariance(placed));
    const Eigen::Index n = placed.joint_covariance->rows();
    Eigen::MatrixXd by_given(n, n);
    for (Eigen::Index k = 0; k < n; ++k) {
      constexpr double kStep = 1e-5;
      by_given.col(k) = Difference(place(Shifted(given, k, kStep)), place(Shifted(given, k, -kStep))) / (2 * kStep);
    }
    const Eigen::MatrixXd expected = by_given * *given.joint_covariance * by_given.transpose();
    const Eigen::MatrixXd added = *placed.joint_covariance - *own.joint_covariance;
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j)
        EXPECT_NEAR(added(i, j), expected(i, j), 1e-3 * std::sqrt(expected(i, i) * expected(j, j))) << i << " " << j;
    }
  }
}

TEST(PlacedCovariance, NamesWhatIsNotGiven) {
  const Room room = MakeRoom();
  geometry::Rig given = Given(room.rig, 1e-3);
  given.cameras[1].params_covariance.reset();
  const SceneResectionReport report = ResectScene(room.marks, given, false, {});
  EXPECT_THAT(report.given_unknown, ElementsAre("cam1"));
  EXPECT_FALSE(report.rig.cameras[1].params_covariance);
  EXPECT_TRUE(report.rig.cameras[1].cam_from_world_covariance);
  EXPECT_TRUE(report.rig.cameras[0].params_covariance);
}

/// A held lens' covariance goes on into the poses of a bundle: the same as the derivative of the solution by the lens.
TEST(CovarianceOfPointBundle, CarriesAHeldLens) {
  const Room room = MakeRoom();
  PointScene scene;
  std::vector<PointObservation> observations;
  for (size_t c = 0; c < room.rig.cameras.size(); ++c) {
    scene.lenses.push_back(room.rig.cameras[c].camera);
    scene.lens_of_camera.push_back(static_cast<int>(c));
    scene.cam_from_world.push_back(room.rig.cameras[c].cam_from_world);
  }
  scene.points = room.marks.x_in_world;
  for (const PointClick& click : room.marks.clicks) observations.push_back({click.camera_idx, click.point_idx, click.px, 1});
  PointBundleOptions options;
  options.reject_outliers = false, options.fix_point = {true, true, true, true, true, true};
  const Eigen::Index p = scene.lenses[1].params.size();
  Eigen::MatrixXd lens = Eigen::MatrixXd::Zero(p, p);
  lens(0, 0) = 4, lens(2, 2) = 1;
  const PointBundleCovariance exact = CovarianceOfPointBundle(scene, observations, options, 0.1);
  const PointBundleCovariance held = CovarianceOfPointBundle(scene, observations, options, 0.1, {std::nullopt, lens});
  ASSERT_EQ(held.status, Status::kOk) << held.message;
  EXPECT_EQ(held.lens[1], lens);
  EXPECT_TRUE(held.lens[0].isZero(0));
  Eigen::MatrixXd by_lens(6, p);
  by_lens.setZero();
  for (const int k : {0, 2}) {
    const auto solve = [&](double step) {
      PointScene other = scene;
      std::vector<PointObservation> seen = observations;
      other.lenses[1].params[k] += step;
      PointBundleOptions exactly = options;
      exactly.cost_tolerance = 1e-15;
      SolvePointBundle(&other, &seen, exactly);
      return other.cam_from_world[1];
    };
    const geometry::Rigid3 plus = solve(0.01), minus = solve(-0.01);
    by_lens.block<3, 1>(0, k) = geometry::RotationLog((plus.rotation * minus.rotation.conjugate()).normalized()) / 0.02;
    by_lens.block<3, 1>(3, k) = (plus.translation - minus.translation) / 0.02;
  }
  const Eigen::MatrixXd expected = by_lens * lens * by_lens.transpose(),
                        added = held.cam_from_world[1] - exact.cam_from_world[1];
  EXPECT_LT((added - expected).norm(), 0.02 * expected.norm());
}

}  // namespace
}  // namespace mvstudio::calib
