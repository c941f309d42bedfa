#include <cmath>

#include "calib/check/rig_check.h"
#include "core/error.h"
#include "core/units.h"
#include "geometry/rigid/rigid3.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Cameras of known truth around waved boards.
Scene MakeCheckScene(int num_cameras, double noise_px = 0.2, uint64_t seed = 1, int num_frames = 20) {
  SceneOptions options;
  options.num_cameras = num_cameras;
  options.num_frames = num_frames;
  options.noise_px = noise_px;
  options.seed = seed;
  return MakeScene(options);
}

/// The truth with a camera's pose of before it was bumped: `motion` took it from there.
geometry::Rig BeforeBump(const Scene& scene, int camera, const geometry::Rigid3& new_cam_from_old_cam) {
  geometry::Rig rig = testing::TruthRig(scene);
  geometry::Rigid3& pose = rig.cameras[static_cast<size_t>(camera)].cam_from_world;
  pose = Inverse(new_cam_from_old_cam) * pose;
  return rig;
}

geometry::Rigid3 BumpOf(double deg, double mm, uint64_t seed) {
  Rng rng(seed);
  geometry::Rigid3 bump;
  const Eigen::Vector3d axis(rng.Normal(), rng.Normal(), rng.Normal()), way(rng.Normal(), rng.Normal(), rng.Normal());
  bump.rotation = geometry::RotationExp(DegToRad(deg) * axis.normalized());
  bump.translation = -(bump.rotation * (1e-3 * mm * way.normalized()));  // the centre moves by `mm`
  return bump;
}

RigCheck Check(const geometry::Rig& rig, const Scene& scene) { return CheckRig(rig, ToInput(scene), {}, {}); }

TEST(RigCheck, NothingMoved) {
  for (const int num_cameras : {2, 3, 6}) {
    const Scene scene = MakeCheckScene(num_cameras);
    const RigCheck check = Check(testing::TruthRig(scene), scene);
    EXPECT_EQ(check.status, Status::kOk);
    EXPECT_EQ(check.verdict.outcome(), Outcome::kPass) << (check.verdict.reasons.empty() ? "" : check.verdict.reasons[0].text);
    EXPECT_TRUE(check.moved.empty());
    EXPECT_TRUE(check.undecided.empty());
    ASSERT_EQ(check.cameras.size(), static_cast<size_t>(num_cameras));
    EXPECT_NEAR(check.rms_px, 0.2 * std::sqrt(2), 0.02);
    for (const CameraCheck& camera : check.cameras) {
      EXPECT_LT(camera.significance, 2.2) << camera.name;
      EXPECT_GT(camera.significance, 0.1) << camera.name;
      EXPECT_LT(camera.shift_px, 0.2) << camera.name;
    }
  }
}

TEST(RigCheck, NamesAndMeasuresTheOneThatMoved) {
  for (const int num_cameras : {3, 4, 7}) {
    const Scene scene = MakeCheckScene(num_cameras, 0.2, 3);
    for (int camera = 0; camera < num_cameras; ++camera) {
      const geometry::Rig before = BeforeBump(scene, camera, BumpOf(0.2, 3, 10 + static_cast<uint64_t>(camera)));
      const RigCheck check = Check(before, scene);
      SCOPED_TRACE(std::to_string(num_cameras) + " cameras, moved " + std::to_string(camera));
      ASSERT_THAT(check.moved, ElementsAre("cam" + std::to_string(camera)));
      EXPECT_TRUE(check.undecided.empty());
      EXPECT_EQ(check.verdict.outcome(), Outcome::kFail);
      ASSERT_EQ(check.verdict.reasons.size(), 1u);
      EXPECT_EQ(check.verdict.reasons[0].code, "CAL-BUMPED");
      const CameraCheck& moved = check.cameras[static_cast<size_t>(camera)];
      EXPECT_NEAR(RadToDeg(moved.rotation_rad), 0.2, 3 * RadToDeg(moved.rotation_sigma_rad));
      EXPECT_NEAR(1e3 * moved.translation_m, 3, 3 * 1e3 * moved.translation_sigma_m);
      EXPECT_LT(RadToDeg(moved.rotation_sigma_rad), 0.05);
      EXPECT_LT(1e3 * moved.translation_sigma_m, 1);
      EXPECT_NEAR(moved.rms_after_px, 0.2 * std::sqrt(2), 0.03);
      EXPECT_NEAR(moved.rms_px, std::hypot(moved.shift_px, moved.rms_after_px), 0.05);
      EXPECT_GT(moved.shift_px, 0.5);
      EXPECT_NEAR(check.rms_px, 0.2 * std::sqrt(2), 0.02) << "the others are not blamed";
      const geometry::RigCamera& repaired = check.repaired.cameras[static_cast<size_t>(camera)];
      const geometry::RigCamera truth = testing::TruthRig(scene).cameras[static_cast<size_t>(camera)];
      EXPECT_LT((repaired.CenterInWorld() - truth.CenterInWorld()).norm(), 4 * moved.translation_sigma_m);
    }
  }
}

/// The standard deviations are those of the errors: normalised errors over seeds have unit variance.
TEST(RigCheck, SigmasAreHonest) {
  double rotation = 0, translation = 0;
  constexpr int kSeeds = 40;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const Scene scene = MakeCheckScene(4, 0.3, 100 + static_cast<uint64_t>(seed), 12);
    const RigCheck check = Check(BeforeBump(scene, 2, BumpOf(0.3, 5, static_cast<uint64_t>(seed))), scene);
    ASSERT_THAT(check.moved, ElementsAre("cam2")) << seed;
    const CameraCheck& moved = check.cameras[2];
    rotation += std::pow((moved.rotation_rad - DegToRad(0.3)) / moved.rotation_sigma_rad, 2) / kSeeds;
    translation += std::pow((moved.translation_m - 5e-3) / moved.translation_sigma_m, 2) / kSeeds;
  }
  // chi^2 of 40 degrees of freedom over 40: 99.9 % within 0.45 and 1.85.
  EXPECT_GT(rotation, 0.45);
  EXPECT_LT(rotation, 1.85);
  EXPECT_GT(translation, 0.45);
  EXPECT_LT(translation, 1.85);
}

/// A board of another size, or cameras that stand farther apart: two cameras cannot tell, and no pose is to be repaired.
TEST(RigCheck, OfTwoCamerasABoardOfAnotherSizeIsNoMotion) {
  const Scene scene = MakeCheckScene(2);
  CalibrateInput input = ToInput(scene);
  for (Board& board : input.boards) board.square_m /= 1.4, board.marker_m /= 1.4;
  const RigCheck check = CheckRig(testing::TruthRig(scene), input, {}, {});
  EXPECT_NEAR(check.scale, 1.4, 2e-3);
  EXPECT_TRUE(check.moved.empty() && check.undecided.empty());
  EXPECT_EQ(check.verdict.outcome(), Outcome::kFail);
  EXPECT_EQ(check.verdict.reasons.at(0).code, "CAL-SCALE");
}

TEST(RigCheck, CamerasWithEachOthersCornersAreNamed) {
  for (const int num_cameras : {2, 4}) {
    const Scene scene = MakeCheckScene(num_cameras);
    CalibrateInput input = ToInput(scene);
    const std::string first = input.cameras[0].name, second = input.cameras[1].name;
    std::swap(input.cameras[0].name, input.cameras[1].name);
    const RigCheck check = CheckRig(testing::TruthRig(scene), input, {}, {});
    EXPECT_THAT(check.exchanged, ::testing::UnorderedElementsAre(first, second));
    EXPECT_TRUE(check.moved.empty() && check.undecided.empty());
    EXPECT_EQ(check.verdict.outcome(), Outcome::kFail);
    EXPECT_EQ(check.verdict.reasons.at(0).code, "CAL-EXCHANGED");
    EXPECT_LT(check.rms_px, 0.5);
  }
}

TEST(RigCheck, BoardLengths) {
  const Scene exact = MakeCheckScene(3, 0);
  RigCheck check = Check(testing::TruthRig(exact), exact);
  EXPECT_LT(check.board_metrics.edge_rms_mm, 1e-6);
  EXPECT_LT(check.board_metrics.pair_rms_mm, 1e-6);
  // A rig that is 1 % too large gives lengths that are 1 % too long: edges of 60 mm by 0.6 mm.
  geometry::Rig large = testing::TruthRig(exact);
  for (auto& camera : large.cameras) camera.cam_from_world.translation *= 1.01;
  check = Check(large, exact);
  EXPECT_NEAR(check.board_metrics.edge_bias_mm, 0.6, 1e-6);
  EXPECT_NEAR(check.board_metrics.edge_median_mm, 0.6, 1e-6);
  EXPECT_GT(check.board_metrics.pair_bias_mm, 1);
  // Told apart from a bump: a warning, no camera blamed; and a bump is found beside it.
  EXPECT_NEAR(check.scale, 1.01, 1e-9);
  EXPECT_TRUE(check.moved.empty() && check.undecided.empty());
  EXPECT_EQ(check.verdict.outcome(), Outcome::kWarn);
  EXPECT_EQ(check.verdict.reasons.at(0).code, "CAL-SCALE");
}

TEST(RigCheck, BumpBesideAWrongScale) {
  const Scene scene = MakeCheckScene(4);
  geometry::Rig rig = BeforeBump(scene, 2, BumpOf(0.2, 3, 3));
  for (auto& camera : rig.cameras) camera.cam_from_world.translation *= 1.01;
  const RigCheck check = Check(rig, scene);
  EXPECT_THAT(check.moved, ElementsAre("cam2"));
  EXPECT_NEAR(check.scale, 1.01, 2e-3);
}

/// Frames in which one camera was late: said, and nobody is blamed.
TEST(RigCheck, LateFramesAreNamed) {
  Scene scene = MakeCheckScene(4);
  for (Detection& detection : scene.detections) {
    if (detection.camera_idx == 1 && detection.frame_idx % 5 == 0) detection.points_px.row(0).array() += 12;
  }
  const RigCheck check = Check(testing::TruthRig(scene), scene);
  EXPECT_TRUE(check.moved.empty() && check.undecided.empty());
  EXPECT_EQ(check.verdict.outcome(), Outcome::kWarn);
  EXPECT_GT(check.cameras[1].num_outlying_views, 2);
  EXPECT_EQ(check.verdict.reasons.at(0).code, "CAL-FRAMES");
}

TEST(RigCheck, ExactWithoutNoise) {
  const Scene scene = MakeCheckScene(4, 0);
  const RigCheck check = Check(BeforeBump(scene, 1, BumpOf(1, 20, 5)), scene);
  ASSERT_THAT(check.moved, ElementsAre("cam1"));
  EXPECT_NEAR(RadToDeg(check.cameras[1].rotation_rad), 1, 1e-5);
  EXPECT_NEAR(1e3 * check.cameras[1].translation_m, 20, 1e-4);
  EXPECT_LT(check.cameras[1].rms_after_px, 1e-4);
}

TEST(RigCheck, TwoCamerasCannotTellWhich) {
  const Scene scene = MakeCheckScene(2);
  const RigCheck check = Check(BeforeBump(scene, 1, BumpOf(0.2, 3, 1)), scene);
  EXPECT_TRUE(check.moved.empty());
  EXPECT_THAT(check.undecided, ElementsAre("cam0", "cam1"));
  EXPECT_EQ(check.verdict.outcome(), Outcome::kFail);
  EXPECT_THAT(check.verdict.reasons.at(0).text, HasSubstr("cannot be told which"));
}

TEST(RigCheck, TwoOfSixMoved) {
  const Scene scene = MakeCheckScene(6);
  geometry::Rig rig = BeforeBump(scene, 4, BumpOf(0.3, 4, 7));
  rig.cameras[1].cam_from_world = Inverse(BumpOf(0.4, 2, 8)) * rig.cameras[1].cam_from_world;
  const RigCheck check = Check(rig, scene);
  EXPECT_THAT(check.moved, ElementsAre("cam1", "cam4"));
  EXPECT_NEAR(RadToDeg(check.cameras[1].rotation_rad), 0.4, 4 * RadToDeg(check.cameras[1].rotation_sigma_rad));
  EXPECT_NEAR(RadToDeg(check.cameras[4].rotation_rad), 0.3, 4 * RadToDeg(check.cameras[4].rotation_sigma_rad));
}

/// One camera alone cannot vouch for itself: which two of three moved is not known.
TEST(RigCheck, TwoOfThreeMovedIsUndecided) {
  const Scene scene = MakeCheckScene(3);
  geometry::Rig rig = BeforeBump(scene, 0, BumpOf(0.5, 6, 7));
  rig.cameras[1].cam_from_world = Inverse(BumpOf(0.6, 8, 8)) * rig.cameras[1].cam_from_world;
  const RigCheck check = Check(rig, scene);
  EXPECT_TRUE(check.moved.empty());
  EXPECT_THAT(check.undecided, ElementsAre("cam0", "cam1", "cam2"));
  EXPECT_EQ(check.verdict.outcome(), Outcome::kFail);
}

TEST(RigCheck, KnockedFarAway) {
  const Scene scene = MakeCheckScene(4);
  const RigCheck check = Check(BeforeBump(scene, 3, BumpOf(25, 400, 9)), scene);
  ASSERT_THAT(check.moved, ElementsAre("cam3"));
  EXPECT_NEAR(RadToDeg(check.cameras[3].rotation_rad), 25, 0.1);
  EXPECT_NEAR(check.cameras[3].translation_m, 0.4, 2e-3);
  EXPECT_NEAR(check.rms_px, 0.2 * std::sqrt(2), 0.02);
}

TEST(RigCheck, GrossCornersDoNotMatter) {
  Scene scene = MakeCheckScene(4);
  Rng rng(5);
  for (Detection& detection : scene.detections) {
    for (Eigen::Index i = 0; i < detection.points_px.cols(); ++i) {
      if (rng.Uniform() < 0.1) detection.points_px.col(i) += Eigen::Vector2d(rng.Uniform(-40, 40), rng.Uniform(-40, 40));
    }
  }
  EXPECT_EQ(Check(testing::TruthRig(scene), scene).verdict.outcome(), Outcome::kPass);
  const RigCheck check = Check(BeforeBump(scene, 2, BumpOf(0.2, 3, 3)), scene);
  EXPECT_THAT(check.moved, ElementsAre("cam2"));
  EXPECT_GT(check.cameras[2].num_rejected, 50);
}

/// A camera that shares boards with nobody is said not to be checked; the others are.
TEST(RigCheck, LonelyCamera) {
  Scene scene = MakeCheckScene(4);
  for (Detection& detection : scene.detections) {
    if (detection.camera_idx == 0) detection.frame_idx += 1000;  // farther than frame numbers are searched
  }
  const RigCheck check = Check(BeforeBump(scene, 2, BumpOf(0.3, 3, 3)), scene);
  EXPECT_THAT(check.moved, ElementsAre("cam2"));
  EXPECT_EQ(check.cameras[0].status, Status::kTooFewViews);
  EXPECT_EQ(check.cameras[0].num_views, 0);
  EXPECT_THAT(check.verdict.reasons.at(0).text, HasSubstr("cam0 shares no board"));
}

TEST(RigCheck, NoSharedBoardIsNoAnswer) {
  Scene scene = MakeCheckScene(2);
  for (Detection& detection : scene.detections) detection.frame_idx += 1000 * detection.camera_idx;
  const RigCheck check = Check(testing::TruthRig(scene), scene);
  EXPECT_EQ(check.status, Status::kTooFewViews);
  EXPECT_EQ(check.verdict.outcome(), Outcome::kFail);
}

TEST(RigCheck, AZoomIsNotPassed) {
  const Scene scene = MakeCheckScene(4);
  geometry::Rig rig = testing::TruthRig(scene);
  rig.cameras[1].camera.params.head<2>() *= 1.03;
  EXPECT_NE(Check(rig, scene).verdict.outcome(), Outcome::kPass);
}

TEST(RigCheck, TheWorldIsAnybodys) {
  const Scene scene = MakeCheckScene(4);
  geometry::Rig rig = BeforeBump(scene, 2, BumpOf(0.2, 3, 3));
  const RigCheck check = Check(rig, scene);
  geometry::Rigid3 other_from_world;
  other_from_world.rotation = geometry::RotationExp(Eigen::Vector3d(1, -2, 0.5));
  other_from_world.translation = {10, -20, 30};
  for (auto& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * Inverse(other_from_world);
  const RigCheck moved = Check(rig, scene);
  EXPECT_EQ(moved.moved, check.moved);
  EXPECT_NEAR(moved.cameras[2].rotation_rad, check.cameras[2].rotation_rad, 1e-3 * check.cameras[2].rotation_sigma_rad);
  EXPECT_NEAR(moved.cameras[2].translation_sigma_m, check.cameras[2].translation_sigma_m,
              1e-4 * check.cameras[2].translation_sigma_m);
}

TEST(RigCheck, RefusesForeignCameras) {
  const Scene scene = MakeCheckScene(2);
  geometry::Rig rig = testing::TruthRig(scene);
  rig.cameras[1].camera.name = "other";
  EXPECT_THAT(MessageOf<UsageError>([&] { Check(rig, scene); }),
              HasSubstr("camera cam1 is not in the calibration, which has cam0, other"));
  rig = testing::TruthRig(scene);
  rig.cameras[1].camera.width_px = 320;
  EXPECT_THAT(MessageOf<UsageError>([&] { Check(rig, scene); }), HasSubstr("640x480 px, the calibration is for 320x480"));
}

/// One camera has nobody to move against: its lens is what is checked.
TEST(RigCheck, OfOneCameraTheLensIsChecked) {
  const Scene scene = MakeCheckScene(1, 0.2, 5);
  geometry::Rig rig = testing::TruthRig(scene);
  const RigCheck same = Check(rig, scene);
  EXPECT_EQ(same.status, Status::kOk);
  EXPECT_EQ(same.verdict.outcome(), Outcome::kPass);
  ASSERT_TRUE(same.cameras[0].lens.has_value());
  EXPECT_LT(same.cameras[0].lens->significance, 2);
  EXPECT_NEAR(same.cameras[0].lens->rms_px, 0.2 * std::sqrt(2), 0.02);
  const double focal_px = rig.cameras[0].camera.fx();
  rig.cameras[0].camera.params.head<2>() *= 0.98;  // it was zoomed since
  const RigCheck zoomed = Check(rig, scene);
  EXPECT_EQ(zoomed.verdict.outcome(), Outcome::kFail);
  ASSERT_EQ(zoomed.verdict.reasons.size(), 1u);
  EXPECT_EQ(zoomed.verdict.reasons[0].code, "CAL-LENS");
  EXPECT_NEAR(zoomed.cameras[0].lens->refitted_focal_px, focal_px, 0.003 * focal_px);
}

TEST(RigCheck, CamerasThatShareNoBoardAreNoRig) {
  const Scene scene = MakeCheckScene(2, 0.2, 6);
  CalibrateInput input = ToInput(scene);
  for (Detection& detection : input.detections) detection.frame_idx += 1000 * detection.camera_idx;
  const RigCheck check = CheckRig(testing::TruthRig(scene), input, {}, {});
  EXPECT_EQ(check.status, Status::kTooFewViews);
  for (const CameraCheck& camera : check.cameras) EXPECT_TRUE(camera.lens.has_value() && !camera.lens->changed) << camera.name;
}

}  // namespace
}  // namespace mvstudio::calib
