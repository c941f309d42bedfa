#include "calib/calibrate.h"

#include "core/error.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

CalibrateOptions Quick(geometry::LensModel model = geometry::LensModel::kBrown4) {
  CalibrateOptions options;
  options.model = model;
  options.holdout_folds = 0;
  return options;
}

TEST(Calibrate, NoiseFreeRigToRoundingError) {
  SceneOptions options;
  options.num_cameras = 3;
  const auto scene = MakeScene(options);
  const CalibrateReport report = Calibrate(testing::ToInput(scene), Quick(), RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT(report.rms_px, 1e-7);
  EXPECT_EQ(GaugeText(report.rig.gauge), "camera cam0");
  const geometry::Rig truth = testing::TruthRig(scene);
  for (size_t c = 0; c < 3; ++c) {
    const geometry::Rigid3 &found = report.rig.cameras[c].cam_from_world, &wanted = truth.cameras[c].cam_from_world;
    EXPECT_LT(geometry::RotationAngle(found.rotation, wanted.rotation), 1e-8);
    EXPECT_LT((found.translation - wanted.translation).norm(), 1e-8);
    EXPECT_LT((report.rig.cameras[c].camera.params - scene.truth.cameras[c].params).cwiseAbs().maxCoeff(), 1e-5);
  }
}

TEST(Calibrate, WorldOfABoardHasZUpAndItsCorner0AtTheOrigin) {
  const auto scene = MakeScene({});
  CalibrateOptions options = Quick();
  options.world.board_frame = 4;
  const CalibrateReport report = Calibrate(testing::ToInput(scene), options, RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_EQ(GaugeText(report.rig.gauge), "board in frame 4");
  geometry::Rigid3 world_from_board;
  world_from_board.rotation = Eigen::Quaterniond(0, 1, 0, 0);  // diag(1, -1, -1)
  const geometry::Rigid3 cam_from_board = scene.truth.cam_from_world[1] * scene.truth.world_from_board[1];
  const geometry::Rigid3 wanted = cam_from_board * geometry::Inverse(world_from_board);
  EXPECT_LT(geometry::RotationAngle(report.rig.cameras[1].cam_from_world.rotation, wanted.rotation), 1e-8);
  EXPECT_LT((report.rig.cameras[1].cam_from_world.translation - wanted.translation).norm(), 1e-8);
  EXPECT_GT(report.rig.cameras[0].CenterInWorld().z(), 0) << "cameras look at the printed side, which is up";
}

TEST(Calibrate, OrderOfCamerasDoesNotMatter) {
  SceneOptions options;
  options.num_cameras = 3;
  options.noise_px = 0.1;
  const auto scene = MakeScene(options);
  CalibrateInput input = testing::ToInput(scene), swapped = input;
  std::swap(swapped.cameras[0], swapped.cameras[2]);
  for (Detection& d : swapped.detections) d.camera_idx = 2 - d.camera_idx;
  const CalibrateReport a = Calibrate(input, Quick(), RunContext()), b = Calibrate(swapped, Quick(), RunContext());
  const geometry::RigDifference difference = geometry::CompareRigs(a.rig, b.rig);
  EXPECT_LT(difference.max_rotation_rad, 1e-6);
  EXPECT_LT(difference.max_translation_m, 1e-6);
  EXPECT_LT(difference.max_focal_relative, 1e-6);
}

TEST(Calibrate, GrossOutliersAreRejectedAndDoNotMatter) {
  SceneOptions options;
  options.noise_px = 0.1;
  const auto scene = MakeScene(options);
  CalibrateInput input = testing::ToInput(scene);
  Rng rng(4);
  int spoiled = 0;
  for (Detection& d : input.detections) {
    for (int i = 0; i < d.num_corners(); i += 17, ++spoiled)
      d.points_px.col(i) += Eigen::Vector2d(rng.Uniform(5, 40), rng.Uniform(-40, 40));
  }
  const CalibrateReport report = Calibrate(input, Quick(), RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.rms_px, 0.1 * std::sqrt(2.0), 0.01);
  EXPECT_NEAR(report.rejected_fraction * (report.num_corners + spoiled), spoiled, 5);
  EXPECT_LT(geometry::CompareRigs(report.rig, testing::TruthRig(scene)).max_translation_m, 1e-3);
}

TEST(Calibrate, DisconnectedCamerasAreNamed) {
  SceneOptions options;
  options.num_cameras = 3;
  const auto scene = MakeScene(options);
  CalibrateInput input = testing::ToInput(scene);
  input.detections.clear();
  for (const Detection& d : scene.detections) {
    if ((d.camera_idx == 2) == (d.frame_idx % 2 == 0)) input.detections.push_back(d);  // camera 2 sees other frames
  }
  const CalibrateReport report = Calibrate(input, Quick(), RunContext());
  EXPECT_EQ(report.status, Status::kDegenerate);
  ASSERT_EQ(report.components.size(), 2u);
  EXPECT_EQ(report.components[0], (std::vector<int>{0, 1}));
  EXPECT_EQ(report.components[1], std::vector<int>{2});
  EXPECT_NE(report.message.find("{cam0, cam1}, {cam2}"), std::string::npos) << report.message;
  EXPECT_EQ(report.verdict.outcome(), Outcome::kFail);
}

TEST(Calibrate, FrontoParallelBoardsAreDegenerate) {
  SceneOptions options;
  options.num_cameras = 1;
  options.max_tilt_rad = 0;
  for (double noise : {0.0, 0.1}) {
    options.noise_px = noise;
    options.model = geometry::LensModel::kPinhole;
    const CalibrateReport report =
        Calibrate(testing::ToInput(MakeScene(options)), Quick(geometry::LensModel::kPinhole), RunContext());
    EXPECT_EQ(report.status, Status::kDegenerate) << "noise " << noise << ": " << report.message;
    EXPECT_NE(report.message.find("tilted"), std::string::npos) << report.message;
  }
}

TEST(Calibrate, ASingleViewIsNotEnough) {
  SceneOptions options;
  options.num_cameras = 1;
  options.num_frames = 1;
  options.noise_px = 0.1;
  const CalibrateReport report =
      Calibrate(testing::ToInput(MakeScene(options)), Quick(geometry::LensModel::kRational8), RunContext());
  EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
  ASSERT_FALSE(report.verdict.reasons.empty());
}

TEST(Calibrate, EmptyNanAndUnknownNames) {
  const auto scene = MakeScene({});
  CalibrateInput empty = testing::ToInput(scene);
  empty.detections.clear();
  const CalibrateReport none = Calibrate(empty, Quick(), RunContext());
  EXPECT_EQ(none.status, Status::kTooFewViews);
  EXPECT_NE(none.message.find("cam0"), std::string::npos);
  CalibrateInput bad = testing::ToInput(scene);
  bad.detections[5].points_px(0, 3) = std::nan("");
  EXPECT_EQ(Calibrate(bad, Quick(), RunContext()).status, Status::kNonFiniteInput);
  CalibrateOptions world = Quick();
  world.world.camera = "nobody";
  EXPECT_THROW(Calibrate(testing::ToInput(scene), world, RunContext()), UsageError);
  world.world = {"", 2};
  EXPECT_EQ(Calibrate(testing::ToInput(scene), world, RunContext()).status, Status::kTooFewViews) << "frame 2 does not exist";
}

}  // namespace
}  // namespace mvstudio::calib
