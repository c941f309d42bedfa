#include "calib/points/point_resection.h"

#include "calib/points/scene_points.h"
#include "core/disk/files.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

/// Points in a room and cameras around it that look at its middle.
struct Room {
  geometry::Rig rig;  // truth
  Eigen::Matrix3Xd points;
  std::vector<PointClick> clicks;
};

Room MakeRoom(int num_cameras, int num_points, double noise_px, uint64_t seed, double flat = 1) {
  Room room;
  Rng rng(seed);
  room.points.resize(3, num_points);
  for (int i = 0; i < num_points; ++i)
    room.points.col(i) << rng.Uniform(-0.8, 0.8), rng.Uniform(-0.8, 0.8), flat * rng.Uniform(-0.6, 0.6);
  for (int c = 0; c < num_cameras; ++c) {
    geometry::RigCamera camera;
    camera.camera = testing::MakeCamera("cam" + std::to_string(c), LensModel::kBrown4, 500 + 10 * c);
    camera.cam_from_world =
        testing::LookAt({3 * std::sin(0.7 * c + 0.3), -3 * std::cos(0.7 * c + 0.3), 0.8}, Eigen::Vector3d::Zero());
    room.rig.cameras.push_back(camera);
    for (int i = 0; i < num_points; ++i) {
      const geometry::Projection p =
          geometry::Project(camera.camera, camera.cam_from_world * Eigen::Vector3d(room.points.col(i)));
      if (p.status != Status::kOk || !geometry::InImage(camera.camera, p.px)) continue;
      room.clicks.push_back({c, i, p.px + noise_px * Eigen::Vector2d(rng.Normal(), rng.Normal())});
    }
  }
  return room;
}

std::vector<geometry::RigCamera> Alone(const Room& room) {
  std::vector<geometry::RigCamera> alone = {room.rig.cameras[0]};
  alone[0].cam_from_world = geometry::Rigid3();
  return alone;
}

double PoseError(const geometry::Rigid3& a, const geometry::Rigid3& b) {
  return geometry::RotationAngle(a.rotation, b.rotation) +
         (geometry::Inverse(a).translation - geometry::Inverse(b).translation).norm();
}

/// Squared Mahalanobis distance of a pose from the truth; it exceeds 30 by chance in 1 of 25000 cases.
double Mahalanobis(const PointResection& r, const geometry::Rigid3& truth) {
  geometry::Vector6d delta;
  delta.head<3>() = geometry::RotationLog(r.rig_from_world.rotation * truth.rotation.conjugate());
  delta.tail<3>() = r.rig_from_world.translation - truth.translation;
  return delta.dot(r.covariance.ldlt().solve(delta));
}

TEST(PointResection, ExactFromFourPointsUp) {
  for (const int n : {4, 5, 6, 12, 40}) {
    const Room room = MakeRoom(1, n, 0, 3);
    const PointResection r = ResectFromPoints(Alone(room), room.clicks, room.points);
    ASSERT_EQ(r.status, Status::kOk) << n << " " << r.message;
    EXPECT_LT(PoseError(r.rig_from_world, room.rig.cameras[0].cam_from_world), 1e-8) << n;
    EXPECT_EQ(r.num_used, static_cast<int>(room.clicks.size()));
  }
}

TEST(PointResection, FlatPointsAreEnoughForAKnownLens) {
  const Room room = MakeRoom(1, 8, 0, 4, 0);
  const PointResection r = ResectFromPoints(Alone(room), room.clicks, room.points);
  ASSERT_EQ(r.status, Status::kOk) << r.message;
  EXPECT_LT(PoseError(r.rig_from_world, room.rig.cameras[0].cam_from_world), 1e-8);
}

TEST(PointResection, ErrorsLieWithinTheCovariance) {
  // Squared Mahalanobis distances of 6 unknowns have the mean 6; over 200 draws its standard deviation is 0.25.
  double sum = 0;
  constexpr int kDraws = 200;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Room room = MakeRoom(1, 16, 1.0, 100 + draw);
    const PointResection r = ResectFromPoints(Alone(room), room.clicks, room.points);
    ASSERT_EQ(r.status, Status::kOk) << r.message;
    sum += r.sigma_px * r.sigma_px * Mahalanobis(r, room.rig.cameras[0].cam_from_world);
  }
  EXPECT_NEAR(sum / kDraws, 6, 3 * 0.25 + 0.3);
}

TEST(PointResection, GrossClicksAreNamed) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Room room = MakeRoom(1, 12, 1.0, seed);
    const size_t n = room.clicks.size();
    ASSERT_GE(n, 10u);
    std::swap(room.clicks[1].px, room.clicks[4].px);
    room.clicks[7].px += Eigen::Vector2d(60, -45);
    const PointResection r = ResectFromPoints(Alone(room), room.clicks, room.points);
    ASSERT_EQ(r.status, Status::kOk) << r.message;
    EXPECT_LT(Mahalanobis(r, room.rig.cameras[0].cam_from_world), 30) << seed;
    for (size_t i = 0; i < n; ++i) EXPECT_EQ(r.rejected[i], i == 1 || i == 4 || i == 7) << seed << " click " << i;
  }
}

TEST(PointResection, DegenerateInputsGiveReasons) {
  Room room = MakeRoom(1, 8, 0, 5);
  const auto solve = [&](const std::vector<PointClick>& clicks) { return ResectFromPoints(Alone(room), clicks, room.points); };
  EXPECT_EQ(solve({room.clicks.begin(), room.clicks.begin() + 3}).status, Status::kTooFewViews);
  for (int i = 0; i < 8; ++i) room.points.col(i) = Eigen::Vector3d(0.1 * i, 0.05 * i, 0.02 * i);
  EXPECT_EQ(solve(room.clicks).status, Status::kDegenerate);
  EXPECT_NE(solve(room.clicks).message.find("one line"), std::string::npos);
  Room random = MakeRoom(1, 12, 0, 6);
  Rng rng(2);
  for (PointClick& click : random.clicks) click.px = {rng.Uniform(0, 640), rng.Uniform(0, 480)};
  EXPECT_NE(ResectFromPoints(Alone(random), random.clicks, random.points).status, Status::kOk);
}

TEST(PointResection, DistantSmallMarksAreRefused) {
  Room room = MakeRoom(1, 6, 0, 7);
  room.points *= 0.01;
  room.clicks.clear();
  Rng rng(1);
  for (int i = 0; i < 6; ++i) {
    const auto p =
        geometry::Project(room.rig.cameras[0].camera, room.rig.cameras[0].cam_from_world * Eigen::Vector3d(room.points.col(i)));
    room.clicks.push_back({0, i, p.px + Eigen::Vector2d(rng.Normal(), rng.Normal())});
  }
  const PointResection r = ResectFromPoints(Alone(room), room.clicks, room.points);
  EXPECT_NE(r.status, Status::kOk);
}

TEST(PointResection, LensIsRefinedOnlyWhenItPays) {
  PointResectionOptions options;
  options.refine_lens = true;
  options.click_sigma_px = 0.3;
  Room room = MakeRoom(1, 30, 0.3, 8);
  std::vector<geometry::RigCamera> rig = Alone(room);
  const PointResection kept = ResectFromPoints(rig, room.clicks, room.points, options);
  ASSERT_EQ(kept.status, Status::kOk);
  EXPECT_FALSE(kept.params_covariance[0].has_value()) << kept.lens_reason;
  rig[0].camera.params.head<2>() *= 1.03;
  const PointResection refined = ResectFromPoints(rig, room.clicks, room.points, options);
  ASSERT_EQ(refined.status, Status::kOk) << refined.message;
  ASSERT_TRUE(refined.params_covariance[0].has_value()) << refined.lens_reason;
  const double sigma = std::sqrt((*refined.params_covariance[0])(0, 0));
  EXPECT_LT(std::abs(refined.cameras[0].fx() - room.rig.cameras[0].camera.fx()), 4 * sigma);
  EXPECT_LT(sigma, 5);
}

TEST(PointResection, FlatPointsDoNotMoveTheLens) {
  PointResectionOptions options;
  options.refine_lens = true;
  const Room room = MakeRoom(1, 30, 0.3, 9, 0);
  const PointResection r = ResectFromPoints(Alone(room), room.clicks, room.points, options);
  ASSERT_EQ(r.status, Status::kOk);
  EXPECT_NE(r.lens_reason.find("coplanar"), std::string::npos);
}

/// The truth seen from another frame: cam_from_rig = cam_from_world * world_from_rig.
TEST(PointResection, WholeRigInOnePiece) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Room room = MakeRoom(4, 12, 0.5, seed);
    geometry::Rigid3 rig_from_world;
    rig_from_world.rotation = geometry::RotationExp({0.3, -1.2, 0.7});
    rig_from_world.translation << 2, -1, 5;
    geometry::Rig rig = room.rig;
    for (auto& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * geometry::Inverse(rig_from_world);
    // Each camera sees too little for itself.
    std::vector<PointClick> few;
    std::vector<int> count(4, 0);
    for (const PointClick& click : room.clicks) {
      if (count[click.camera_idx] < 3 && click.point_idx % 4 != click.camera_idx)
        few.push_back(click), ++count[click.camera_idx];
    }
    ASSERT_GE(few.size(), 10u);
    const PointResection r = ResectFromPoints(rig.cameras, few, room.points);
    ASSERT_EQ(r.status, Status::kOk) << seed << " " << r.message;
    EXPECT_LT(Mahalanobis(r, rig_from_world), 30) << seed;
    few[2].px.x() += 80;
    const PointResection robust = ResectFromPoints(rig.cameras, few, room.points);
    ASSERT_EQ(robust.status, Status::kOk) << seed << " " << robust.message;
    EXPECT_TRUE(robust.rejected[2]);
    EXPECT_LT(Mahalanobis(robust, rig_from_world), 30) << seed;
  }
}

/// Few marks far away through a long lens, the world's origin far off; lengths in `units_per_m`.
struct FarMarks {
  std::vector<geometry::RigCamera> rig = std::vector<geometry::RigCamera>(1);
  Eigen::Matrix3Xd points;
  std::vector<PointClick> clicks;
};

FarMarks MakeFarMarks(double units_per_m) {
  FarMarks marks;
  marks.rig[0].camera = geometry::MakePinhole("far", 4000, 3000, 5000);
  const Eigen::Vector3d middle(60, -80, 5);
  const geometry::Rigid3 cam_from_world = testing::LookAt(middle + Eigen::Vector3d(15, -20, 2), middle);
  Rng rng(12);
  marks.points.resize(3, 14);
  for (int i = 0; i < 14; ++i) {
    marks.points.col(i) = middle + Eigen::Vector3d(rng.Uniform(-2, 2), rng.Uniform(-2, 2), rng.Uniform(-2, 2));
    const auto p = geometry::Project(marks.rig[0].camera, cam_from_world * Eigen::Vector3d(marks.points.col(i)));
    EXPECT_EQ(p.status, Status::kOk);
    marks.clicks.push_back({0, i, p.px + 0.3 * Eigen::Vector2d(rng.Normal(), rng.Normal())});
  }
  marks.points *= units_per_m;
  return marks;
}

TEST(PointResection, UnitsMakeNoDifference) {
  PointResectionOptions options;
  options.click_sigma_px = 0.3;
  const auto solve = [&](double units_per_m) {
    const FarMarks marks = MakeFarMarks(units_per_m);
    return ResectFromPoints(marks.rig, marks.clicks, marks.points, options);
  };
  const PointResection metres = solve(1);
  ASSERT_EQ(metres.status, Status::kOk) << metres.message;
  const geometry::Vector6d sigmas = metres.covariance.diagonal().cwiseSqrt();
  for (const double units_per_m : {1e-3, 1e3, 1e6}) {
    SCOPED_TRACE(units_per_m);
    const PointResection r = solve(units_per_m);
    ASSERT_EQ(r.status, Status::kOk) << r.message;
    EXPECT_EQ(r.num_used, metres.num_used);
    geometry::Vector6d to_metres = geometry::Vector6d::Ones(), delta;
    to_metres.tail<3>() /= units_per_m;
    delta << geometry::RotationLog(r.rig_from_world.rotation * metres.rig_from_world.rotation.conjugate()),
        r.rig_from_world.translation / units_per_m - metres.rig_from_world.translation;
    EXPECT_LT(delta.cwiseQuotient(sigmas).cwiseAbs().maxCoeff(), 1e-3);
    const auto in_sigmas = [&](const Eigen::Matrix<double, 6, 6>& covariance) -> Eigen::Matrix<double, 6, 6> {
      return sigmas.cwiseInverse().asDiagonal() * covariance * sigmas.cwiseInverse().asDiagonal();
    };
    const Eigen::Matrix<double, 6, 6> covariance = to_metres.asDiagonal() * r.covariance * to_metres.asDiagonal();
    EXPECT_LT((in_sigmas(covariance) - in_sigmas(metres.covariance)).cwiseAbs().maxCoeff(), 1e-4);
    const Eigen::MatrixXd by_lens = to_metres.asDiagonal() * r.unknowns_by_given.leftCols(4),
                          lens_in_metres = metres.unknowns_by_given.leftCols(4);
    for (Eigen::Index i = 0; i < 6; ++i)
      EXPECT_LT((by_lens.row(i) - lens_in_metres.row(i)).norm(), 1e-4 * lens_in_metres.row(i).norm()) << i;
  }
}

std::string Write(const TempDir& folder, const std::string& name, const std::string& text) {
  WriteFileAtomic(folder / name, text);
  return folder / name;
}

TEST(ScenePoints, OneFileOrTwo) {
  TempDir folder;
  const std::string clicks =
      Write(folder, "c.csv", "camera,point,x_px,y_px\nleft,door,10,20\nleft,lamp,30,40\nright,door,1,2\n");
  const std::string places = Write(folder, "p.csv", "point,x,y,z\ndoor,1,2,3\nlamp,4,5,6\nunused,7,8,9\n");
  const ScenePoints two = ReadScenePoints({places, clicks});
  EXPECT_EQ(two.cameras, (std::vector<std::string>{"left", "right"}));
  ASSERT_EQ(two.clicks.size(), 3u);
  EXPECT_EQ(two.x_in_world.col(two.clicks[1].point_idx), Eigen::Vector3d(4, 5, 6));
  const std::string all = Write(folder, "a.csv", "point,x,y,z,camera,x_px,y_px\ndoor,1,2,3,left,10,20\ndoor,1,2,3,right,1,2\n");
  EXPECT_EQ(ReadScenePoints({all}).clicks.size(), 2u);
  const auto fails = [&](const std::string& text) {
    return MessageOf<Error>([&] { ReadScenePoints({Write(folder, "b.csv", text)}); });
  };
  EXPECT_NE(fails("camera,point,x_px,y_px\nleft,door,10,20\n").find("has no place"), std::string::npos);
  EXPECT_NE(fails("point,x,y,z\ndoor,1,2,3\n").find("no camera sees"), std::string::npos);
  EXPECT_NE(fails("point,x,y,z,camera,x_px,y_px\na,1,2,3,l,1,1\na,1,2,4,r,1,1\n").find("another place"), std::string::npos);
  EXPECT_NE(fails("point,x,y,z,camera,x_px,y_px\na,1,2,3,l,1,1\na,1,2,3,l,1,1\n").find("twice"), std::string::npos);
  EXPECT_NE(fails("a,b\n1,2\n").find("neither"), std::string::npos);
}

TEST(ScenePoints, EveryCameraIsPlacedWithItsCovariance) {
  const Room room = MakeRoom(3, 14, 0.5, 11);
  ScenePoints points;
  points.x_in_world = room.points;
  for (int i = 0; i < 14; ++i) points.names.push_back("p" + std::to_string(i));
  points.cameras = geometry::CameraNames(room.rig);
  points.clicks = room.clicks;
  points.clicks[2].px.y() += 70;
  const SceneResectionReport report = ResectScene(points, room.rig, false, {});
  ASSERT_EQ(report.rig.cameras.size(), 3u);
  ASSERT_EQ(report.cameras[0].gross.size(), 1u);
  EXPECT_EQ(report.cameras[0].gross[0].substr(0, 4), "p2: ");
  for (int c = 0; c < 3; ++c) {
    EXPECT_LT(PoseError(report.rig.cameras[c].cam_from_world, room.rig.cameras[c].cam_from_world), 0.02);
    EXPECT_TRUE(report.rig.cameras[c].cam_from_world_covariance.has_value());
  }
  const SceneResectionReport rigid = ResectScene(points, room.rig, true, {});
  ASSERT_EQ(rigid.rig.cameras.size(), 3u);
  EXPECT_LT(PoseError(rigid.rig.cameras[2].cam_from_world, room.rig.cameras[2].cam_from_world), 0.02);
  points.cameras[1] = "other";
  EXPECT_NE(MessageOf<UsageError>([&] { ResectScene(points, room.rig, false, {}); }).find("'other'"), std::string::npos);
}

}  // namespace
}  // namespace mvstudio::calib
