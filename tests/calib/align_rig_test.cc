#include "calib/points/align_rig.h"

#include <fstream>

#include "calib/board/floor.h"
#include "core/error.h"
#include "geometry/rig/rig_covariance.h"
#include "tests/calib/synthetic.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::Rig;
using geometry::Rigid3;

const Rigid3 kElsewhere{geometry::RotationExp(Eigen::Vector3d(0.3, -0.5, 1)), Eigen::Vector3d(4, -2, 1)};

testing::Scene MakeAlignScene(double noise_px) {
  testing::SceneOptions options;
  options.num_cameras = 3, options.num_frames = 12, options.noise_px = noise_px, options.model = geometry::LensModel::kBrown2;
  return testing::MakeScene(options);
}

/// The largest difference of the cameras' poses, radians plus metres.
double LargestPoseDifference(const Rig& a, const Rig& b) {
  double worst = 0;
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    const Rigid3 &x = a.cameras[c].cam_from_world, &y = b.cameras[c].cam_from_world;
    worst = std::max(worst, geometry::RotationAngle(x.rotation, y.rotation) + (x.translation - y.translation).norm());
  }
  return worst;
}

TEST(AlignToBoard, WithoutNoiseTheBoardIsTheWorld) {
  const testing::Scene scene = MakeAlignScene(0);
  const Rig truth = testing::TruthRig(scene);
  const int64_t frame = scene.truth.frames[4];
  const RigAlignment found = AlignToBoard(geometry::InWorld(truth, kElsewhere), testing::ToInput(scene), frame);
  ASSERT_EQ(found.status, Status::kOk) << found.message;
  const Rigid3 board_from_cam0 = geometry::Inverse(scene.truth.cam_from_world[0] * scene.truth.world_from_board[4]);
  EXPECT_LT(LargestPoseDifference(found.rig, geometry::InWorld(truth, WorldFromFloorBoard() * board_from_cam0)), 1e-7);
  EXPECT_EQ(GaugeText(found.rig.gauge), "board in frame " + std::to_string(frame));
  EXPECT_LT(found.rms_px, 1e-6);
  for (const geometry::RigCamera& camera : found.rig.cameras) EXPECT_GT(camera.CenterInWorld().z(), 0) << "z is up";
}

TEST(AlignToBoard, UncertaintyIsThatOfACalibrationInTheBoardsWorld) {
  const testing::Scene scene = MakeAlignScene(0.3);
  CalibrateOptions options = testing::PlainOptions();
  options.motions = false;
  const CalibrateInput input = testing::ToInput(scene);
  const CalibrateReport by_camera = Calibrate(input, options, {});
  const int64_t frame = scene.truth.frames[3];
  options.world = {"", frame};
  const CalibrateReport by_board = Calibrate(input, options, {});
  ASSERT_EQ(by_camera.status, Status::kOk);
  ASSERT_EQ(by_board.status, Status::kOk);
  const RigAlignment found = AlignToBoard(by_camera.rig, input, frame);
  ASSERT_EQ(found.status, Status::kOk) << found.message;
  EXPECT_LT(LargestPoseDifference(found.rig, by_board.rig), 2e-3);
  for (size_t c = 0; c < 3; ++c) {
    const geometry::Vector6d got = found.rig.cameras[c].cam_from_world_covariance->diagonal().cwiseSqrt();
    const geometry::Vector6d wanted = by_board.rig.cameras[c].cam_from_world_covariance->diagonal().cwiseSqrt();
    for (int k = 0; k < 6; ++k) EXPECT_NEAR(got[k] / wanted[k], 1, 0.25) << c << " " << k;
  }
}

/// The rig moved elsewhere, solved again there with one pose held: the covariances are those that were carried.
TEST(InWorld, CarriedCovarianceIsThatOfASolutionInTheNewWorld) {
  const testing::Scene scene = MakeAlignScene(0.3);
  CalibrateOptions options = testing::PlainOptions();
  options.motions = false;
  CalibrateInput input = testing::ToInput(scene);
  const CalibrateReport first = Calibrate(input, options, {});
  ASSERT_EQ(first.status, Status::kOk);
  const Rig moved = geometry::InWorld(first.rig, kElsewhere);
  input.start = moved;
  options.model.reset();
  options.fix = {{HeldPart::What::kPoses, {"cam0"}}};
  const CalibrateReport second = Calibrate(input, options, {});
  ASSERT_EQ(second.status, Status::kOk) << second.message;
  ASSERT_LT(LargestPoseDifference(second.rig, moved), 1e-5);
  for (size_t c = 0; c < 3; ++c) {
    const auto &got = *moved.cameras[c].cam_from_world_covariance, &wanted = *second.rig.cameras[c].cam_from_world_covariance;
    EXPECT_LT((got - wanted).norm(), 5e-3 * wanted.norm() + 1e-18) << c;
  }
}

TEST(AlignToBoard, ABoardThatNobodySawIsRefused) {
  const testing::Scene scene = MakeAlignScene(0);
  EXPECT_THROW(AlignToBoard(testing::TruthRig(scene), testing::ToInput(scene), 2), UsageError);
}

/// Points of a room in two worlds.
PlacePairs Pairs(int count, double scale, double noise_m) {
  Rng rng(7);
  PlacePairs pairs;
  pairs.x_in_old.resize(3, count), pairs.x_in_new.resize(3, count);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d x(rng.Uniform(-2, 2), rng.Uniform(-2, 2), rng.Uniform(0, 2)),
        noise(rng.Normal(), rng.Normal(), rng.Normal());
    pairs.names.push_back("p" + std::to_string(i));
    pairs.x_in_old.col(i) = x;
    pairs.x_in_new.col(i) = kElsewhere * Eigen::Vector3d(scale * x) + noise_m * noise;
  }
  return pairs;
}

TEST(AlignToPlaces, MotionAndScaleAreFound) {
  const Rig rig = testing::TruthRig(MakeAlignScene(0));
  const RigAlignment rigid = AlignToPlaces(rig, Pairs(8, 1, 0), false);
  ASSERT_EQ(rigid.status, Status::kOk);
  EXPECT_LT(LargestPoseDifference(rigid.rig, geometry::InWorld(rig, kElsewhere)), 1e-9);
  const RigAlignment scaled = AlignToPlaces(rig, Pairs(8, 1.25, 0), true);
  ASSERT_EQ(scaled.status, Status::kOk);
  EXPECT_NEAR(scaled.scale, 1.25, 1e-12);
  EXPECT_LT(LargestPoseDifference(scaled.rig, geometry::InWorld(rig, kElsewhere, 1.25)), 1e-9);
  EXPECT_GT(AlignToPlaces(rig, Pairs(8, 1.25, 0), false).rms_m, 0.1) << "a wrong scale is no motion";
}

TEST(AlignToPlaces, WhatDetermineNothingIsRefused) {
  const Rig rig = testing::TruthRig(MakeAlignScene(0));
  EXPECT_EQ(AlignToPlaces(rig, Pairs(2, 1, 0), false).status, Status::kTooFewViews);
  PlacePairs line = Pairs(6, 1, 0);
  for (int i = 0; i < 6; ++i) line.x_in_old.col(i) = Eigen::Vector3d(i, i, i), line.x_in_new.col(i) = Eigen::Vector3d(i, -i, i);
  EXPECT_EQ(AlignToPlaces(rig, line, false).status, Status::kDegenerate);
  PlacePairs mirrored = Pairs(8, 1, 1e-3);
  mirrored.x_in_old.row(0) *= -1;
  const RigAlignment refused = AlignToPlaces(rig, mirrored, false);
  EXPECT_EQ(refused.status, Status::kDegenerate);
  EXPECT_THAT(refused.message, HasSubstr("left-handed"));
}

TEST(AlignToPlaces, APointFarOffIsNamed) {
  PlacePairs pairs = Pairs(12, 1, 1e-3);
  pairs.x_in_new(1, 5) += 0.3;
  const RigAlignment found = AlignToPlaces(testing::TruthRig(MakeAlignScene(0)), pairs, false);
  ASSERT_EQ(found.gross.size(), 1u);
  EXPECT_THAT(found.gross[0], HasSubstr("p5: "));
}

TEST(AlignToClicks, ScaleComesFromTriangulatedPoints) {
  const testing::Scene scene = MakeAlignScene(0);
  const Rig truth = testing::TruthRig(scene);
  ScenePoints points;
  points.x_in_world.resize(3, 8);
  points.cameras = {"cam0", "cam1", "cam2"};
  for (int i = 0; i < 8; ++i) {
    points.names.push_back("p" + std::to_string(i));
    const Eigen::Vector3d x(0.2 * (i % 2) - 0.1, 0.2 * (i / 2 % 2) - 0.1, 1 + 0.1 * i);
    points.x_in_world.col(i) = kElsewhere * x;
    for (int c = 0; c < 3; ++c) {
      const auto& camera = truth.cameras[static_cast<size_t>(c)];
      points.clicks.push_back({c, i, geometry::Project(camera.camera, camera.cam_from_world * x).px});
    }
  }
  const Rig small = geometry::InWorld(truth, Rigid3(), 0.5);
  const RigAlignment found = AlignToClicks(small, points, true, {});
  ASSERT_EQ(found.status, Status::kOk) << found.message;
  EXPECT_NEAR(found.scale, 2, 1e-6);
  EXPECT_LT(LargestPoseDifference(found.rig, geometry::InWorld(truth, kElsewhere)), 1e-6);
  const RigAlignment rigid = AlignToClicks(truth, points, false, {});
  ASSERT_EQ(rigid.status, Status::kOk) << rigid.message;
  EXPECT_LT(LargestPoseDifference(rigid.rig, geometry::InWorld(truth, kElsewhere)), 1e-6);
}

TEST(PlacePairs, AreReadFromATable) {
  const mvstudio::testing::TempDir folder;
  const std::string path = folder / "pairs.csv";
  std::ofstream(path) << "point,x,y,z,x_old,y_old,z_old\ndoor,1,2,3,4,5,6\n";
  ASSERT_TRUE(HasPlacePairs(path));
  const PlacePairs pairs = ReadPlacePairs(path);
  EXPECT_EQ(pairs.names[0], "door");
  EXPECT_EQ(pairs.x_in_new.col(0), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(pairs.x_in_old.col(0), Eigen::Vector3d(4, 5, 6));
}

}  // namespace
}  // namespace mvstudio::calib
