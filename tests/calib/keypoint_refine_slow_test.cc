#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <map>

#include "calib/formats/formats.h"
#include "calib/keypoints/place.h"
#include "calib/keypoints/refine.h"
#include "core/error.h"
#include "dataset/pose/pose2d.h"
#include "geometry/rig/alignment.h"
#include "geometry/skeleton/skeleton.h"
#include "tests/calib/keypoint_support.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::calib {
namespace {

PeopleOptions Take(int num_frames = 40, uint64_t seed = 1) {
  PeopleOptions options;
  options.num_frames = num_frames, options.seed = seed;
  return options;
}

KeypointRefineOptions PosesOnly() {
  KeypointRefineOptions options;
  options.lenses = false;
  return options;
}

std::string Chosen(const KeypointRefineReport& report, const std::string& group) {
  for (const KeypointDecision& decision : report.decisions)
    if (decision.group == group && decision.chosen) return decision.choice;
  return "not asked";
}

/// Lenses alone are known at first: the person places the cameras, and the adjustment brings them to the truth.
TEST(KeypointRefine, EndsAtTheTruthFromCamerasThatAPersonPlaced) {
  const geometry::Rig truth = PeopleRig(4);
  geometry::Rig lenses = truth;
  for (geometry::RigCamera& camera : lenses.cameras) camera.cam_from_world = {};
  const auto frames = FilmPeople(truth, Take(60));
  const PlacedRig placed = PlaceFromKeypoints(lenses, frames, {{{0, 1}, 0.5}}, 0.3);
  ASSERT_EQ(placed.status, Status::kOk) << placed.message;
  const auto report = RefineFromKeypoints(placed.rig, frames, {{0, 1}, {2, 3}}, {}, {}, PosesOnly());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT(report.after.median_px, 2.5);
  const geometry::Rig expected = AlignToGiven(truth, report.rig);
  for (size_t c = 0; c < 4; ++c) {
    const geometry::RigCamera &found = report.rig.cameras[c], &wanted = expected.cameras[c];
    EXPECT_LT(geometry::RotationAngle(found.cam_from_world.rotation, wanted.cam_from_world.rotation), 0.003) << c;
    EXPECT_LT((found.CenterInWorld() - wanted.CenterInWorld()).norm(), 0.004 * wanted.CenterInWorld().norm() + 0.015) << c;
  }
}

TEST(KeypointRefine, RecoversARigThatIsOffEverywhere) {
  const geometry::Rig truth = PeopleRig(4);
  const geometry::Rig start = testing::Disturbed(truth, 0.05, 0.2, 11);
  const auto report = RefineFromKeypoints(start, FilmPeople(truth, Take()), {{0, 1}, {2, 3}}, {}, {}, PosesOnly());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_GT(report.before.median_px, 20);
  EXPECT_LT(report.after.median_px, 2.5);
  EXPECT_LT(report.after.limb_std_mm, 0.3 * report.before.limb_std_mm);
  EXPECT_EQ(Chosen(report, "extrinsics"), "free");
  EXPECT_EQ(report.suspect.fault, CameraFault::kNone);
  // Frame and scale are those of the start: the truth's shape, in the start's place.
  const geometry::Rig expected = AlignToGiven(truth, start);
  for (size_t c = 0; c < 4; ++c) {
    const geometry::RigCamera &found = report.rig.cameras[c], &wanted = expected.cameras[c];
    geometry::Vector6d off;
    off.head<3>() = geometry::RotationLog(found.cam_from_world.rotation * wanted.cam_from_world.rotation.conjugate());
    off.tail<3>() = found.cam_from_world.translation - wanted.cam_from_world.translation;
    EXPECT_LT(off.head<3>().norm(), 0.003);
    EXPECT_LT((found.CenterInWorld() - wanted.CenterInWorld()).norm(), 0.015);
    ASSERT_TRUE(found.cam_from_world_covariance);
    // 6 degrees of freedom: beyond 40 once in 2 million.
    EXPECT_LT(off.dot(found.cam_from_world_covariance->ldlt().solve(off)), 40);
  }
}

TEST(KeypointRefine, NamesTheCameraThatWasRotated) {
  const geometry::Rig truth = PeopleRig(4);
  geometry::Rig given = truth;
  testing::Bump({0, kPi / 180, 0}, {0, 0, 0}, &given.cameras[2]);
  const auto report = RefineFromKeypoints(given, FilmPeople(truth, Take()), {}, {}, {}, PosesOnly());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_EQ(report.suspect.fault, CameraFault::kPose) << report.suspect.message;
  EXPECT_EQ(report.suspect.camera_idx, 2);
  EXPECT_NEAR(report.suspect.rotation_rad, kPi / 180, 3 * report.suspect.rotation_sigma_rad);
  EXPECT_LT(report.suspect.rotation_sigma_rad, 0.1 * kPi / 180);
  EXPECT_LT(report.suspect.translation_m, 4 * report.suspect.translation_sigma_m);
  EXPECT_NE(report.suspect.message.find("cam2"), std::string::npos);
  for (const size_t c : {0, 1, 3}) EXPECT_EQ(report.cameras[c].rotation_rad, 0);
}

TEST(KeypointRefine, NamesTheFocalLengthThatIsOff) {
  const geometry::Rig truth = PeopleRig(4);
  geometry::Rig given = truth;
  given.cameras[1].camera.params.head<2>() *= 1.02;
  const auto report = RefineFromKeypoints(given, FilmPeople(truth, Take()), {}, {}, {}, PosesOnly());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_EQ(report.suspect.fault, CameraFault::kFocal) << report.suspect.message;
  EXPECT_EQ(report.suspect.camera_idx, 1);
  EXPECT_NEAR(report.suspect.scale, 1 / 1.02, 3 * report.suspect.scale_sigma);
  EXPECT_LT(report.suspect.scale_sigma, 0.003);
}

TEST(KeypointRefine, NamesTheImagesThatWereResized) {
  const geometry::Rig truth = PeopleRig(4);
  const double scale = 1080.0 / 1088;
  for (const bool both : {true, false}) {
    auto frames = FilmPeople(truth, Take());
    for (auto& frame : frames) {
      for (auto& key : frame.people[3][0]) {
        key.px.x() = scale * (key.px.x() + 0.5) - 0.5;
        if (both) key.px.y() = scale * (key.px.y() + 0.5) - 0.5;
      }
    }
    const auto report = RefineFromKeypoints(truth, frames, {}, {}, {}, PosesOnly());
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_EQ(report.suspect.fault, both ? CameraFault::kImage : CameraFault::kImageWidth) << report.suspect.message;
    EXPECT_EQ(report.suspect.camera_idx, 3);
    EXPECT_NEAR(report.suspect.scale, scale, 3 * report.suspect.scale_sigma);
    EXPECT_LT(report.suspect.scale_sigma, 0.002);
  }
}

TEST(KeypointRefine, LensesAreFreedOnlyWhereThatPays) {
  const geometry::Rig truth = PeopleRig(4);
  const auto frames = FilmPeople(truth, Take());
  const geometry::Rig start = testing::Disturbed(truth, 0.01, 0.03, 5);
  const auto right = RefineFromKeypoints(start, frames, {}, {}, {}, {});
  for (const char* group : {"focal", "image-scale", "principal-point", "distortion"}) EXPECT_EQ(Chosen(right, group), "keep");

  geometry::Rig focal = start;
  for (size_t c = 0; c < 4; ++c) focal.cameras[c].camera.params.head<2>() *= c % 2 ? 1.03 : 0.97;
  const auto refocused = RefineFromKeypoints(focal, frames, {}, {}, {}, {});
  EXPECT_EQ(Chosen(refocused, "focal"), "free");
  for (size_t c = 0; c < 4; ++c) EXPECT_NEAR(refocused.rig.cameras[c].camera.fx() / truth.cameras[c].camera.fx(), 1, 0.01);
}

TEST(KeypointRefine, DistortionIsDroppedOrFreedWhereItIsWrong) {
  const geometry::Rig pinholes = PeopleRig(4, geometry::LensModel::kPinhole);
  geometry::Rig invented = pinholes;
  for (geometry::RigCamera& camera : invented.cameras) {
    camera.camera.model = geometry::LensModel::kBrown2;
    camera.camera.params.conservativeResize(6);
    camera.camera.params.tail<2>() << 0.25, 0.3;
  }
  const auto dropped = RefineFromKeypoints(invented, FilmPeople(pinholes, Take()), {}, {}, {}, {});
  EXPECT_EQ(Chosen(dropped, "distortion"), "drop");
  EXPECT_EQ(dropped.rig.cameras[0].camera.model, geometry::LensModel::kPinhole);

  const geometry::Rig bent = PeopleRig(4, geometry::LensModel::kBrown1);
  geometry::Rig straight = bent;
  for (geometry::RigCamera& camera : straight.cameras) camera.camera = geometry::PinholeOf(camera.camera);
  const auto freed = RefineFromKeypoints(straight, FilmPeople(bent, Take()), {}, {}, {}, {});
  EXPECT_EQ(Chosen(freed, "distortion"), "free");
  ASSERT_EQ(freed.rig.cameras[0].camera.params.size(), 5);
  EXPECT_NEAR(freed.rig.cameras[0].camera.params[4], bent.cameras[0].camera.params[4], 0.05);
}

TEST(KeypointRefine, NeverWorseThanTheInput) {
  const geometry::Rig truth = PeopleRig(4);
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const auto report = RefineFromKeypoints(truth, FilmPeople(truth, Take(16, seed)), {}, {}, {}, PosesOnly());
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_TRUE(report.kept_input);
    EXPECT_FALSE(report.message.empty());
    EXPECT_EQ(report.before.median_px, report.after.median_px);
    for (size_t c = 0; c < 4; ++c) {
      EXPECT_EQ(report.rig.cameras[c].cam_from_world.translation, truth.cameras[c].cam_from_world.translation);
      EXPECT_EQ(report.rig.cameras[c].camera.params, truth.cameras[c].camera.params);
    }
  }
}

TEST(KeypointRefine, AWorldFarAwayChangesNothing) {
  const Eigen::Vector3d far(5e5, -4e6, 300);
  const geometry::Rig near_truth = PeopleRig(3), far_truth = PeopleRig(3, geometry::LensModel::kBrown2, far);
  const auto near = RefineFromKeypoints(testing::Disturbed(near_truth, 0.02, 0.05, 2), FilmPeople(near_truth, Take(20)), {}, {},
                                        {}, PosesOnly());
  const auto moved = RefineFromKeypoints(testing::Disturbed(far_truth, 0.02, 0.05, 2), FilmPeople(far_truth, Take(20), far), {},
                                         {}, {}, PosesOnly());
  ASSERT_EQ(moved.status, Status::kOk) << moved.message;
  for (size_t c = 0; c < 3; ++c)
    EXPECT_LT((moved.rig.cameras[c].CenterInWorld() - far - near.rig.cameras[c].CenterInWorld()).norm(), 1e-4);
  EXPECT_NEAR(near.after.median_px, moved.after.median_px, 1e-3);
}

TEST(KeypointRefine, TwoCamerasAreEnough) {
  const geometry::Rig truth = PeopleRig(5);
  geometry::Rig two = truth;
  two.cameras.resize(2);
  const geometry::Rig start = testing::Disturbed(two, 0.02, 0.05, 7);
  const auto report = RefineFromKeypoints(start, FilmPeople(two, Take()), {}, {}, {}, PosesOnly());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT(report.after.median_px, report.before.median_px);
  const auto baseline = [](const geometry::Rig& rig) {
    return (rig.cameras[0].CenterInWorld() - rig.cameras[1].CenterInWorld()).norm();
  };
  EXPECT_NEAR(baseline(report.rig), baseline(start), 1e-9);
}

TEST(KeypointRefine, DegenerateTakesGiveAStatus) {
  const geometry::Rig rig = PeopleRig(4);
  const auto status = [&](const geometry::Rig& given, const std::vector<triangulate::DetectedFrame>& frames) {
    const auto report = RefineFromKeypoints(given, frames, {}, {}, {}, PosesOnly());
    EXPECT_EQ(report.message.find('\n'), std::string::npos);
    EXPECT_FALSE(report.message.empty());
    return report.status;
  };
  const auto frames = FilmPeople(rig, Take(12));
  EXPECT_EQ(status(rig, {}), Status::kTooFewViews);
  EXPECT_EQ(status(rig, {frames[0], frames[1]}), Status::kTooFewViews);

  auto alone = frames;  // camera 3 never sees what the others see
  for (auto& frame : alone) frame.people[3].clear();
  EXPECT_EQ(status(rig, alone), Status::kTooFewViews);

  geometry::Rig one = rig;
  one.cameras.resize(1);
  EXPECT_EQ(status(one, {}), Status::kTooFewViews);
  geometry::Rig broken = rig;
  broken.cameras[1].cam_from_world.translation.x() = NAN;
  EXPECT_EQ(status(broken, frames), Status::kNonFiniteInput);

  Rng rng(3);  // one spot of a person who stands still: turns and places of the cameras cannot be told apart
  auto still = FilmPeople(rig, Take(12));
  for (auto& frame : still) {
    for (size_t c = 0; c < 4; ++c) {
      for (auto& key : frame.people[c][0])
        key = {frames[0].people[c][0][0].px + Eigen::Vector2d(rng.Normal(), rng.Normal()), 0.9};
    }
  }
  EXPECT_EQ(status(rig, still), Status::kDegenerate);
}

/// Squared Mahalanobis distance of all poses to the truth: its mean over draws is the 11 numbers that a rig of three cameras
/// has beside its frame and scale.
TEST(KeypointRefine, CovarianceIsHonest) {
  constexpr int kDraws = 12;
  const geometry::Rig truth = PeopleRig(4);
  double sum = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    PeopleOptions options = Take(30, 100 + static_cast<uint64_t>(draw));
    options.outlier_fraction = 0.05;
    const auto joints = testing::JointsOf(truth, FilmPeople(truth, options));
    KeypointSolution solution = SolveKeypoints(truth, joints, {}, 0, 1);
    solution.rig = AlignToGiven(solution.rig, truth);
    const KeypointCovariance covariance = CovarianceOfKeypoints(solution, joints, {}, 1);
    ASSERT_EQ(covariance.status, Status::kOk) << covariance.message;
    Eigen::VectorXd off = Eigen::VectorXd::Zero(covariance.joint.rows());
    for (size_t c = 0; c < 4; ++c) {
      const geometry::Rigid3 &found = solution.rig.cameras[c].cam_from_world, &wanted = truth.cameras[c].cam_from_world;
      off.segment<3>(covariance.begin[c + 1] - 6) = geometry::RotationLog(found.rotation * wanted.rotation.conjugate());
      off.segment<3>(covariance.begin[c + 1] - 3) = found.translation - wanted.translation;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance.joint);
    for (Eigen::Index i = 0; i < off.size(); ++i) {
      if (!(eigen.eigenvalues()[i] > 1e-9 * eigen.eigenvalues().maxCoeff())) continue;
      const double along = eigen.eigenvectors().col(i).dot(off);
      sum += along * along / eigen.eigenvalues()[i];
    }
  }
  // The common factor is estimated from 10 stretches times 17 numbers (11 %); the mean of the draws scatters by 10 %.
  EXPECT_GT(sum / kDraws / 17, 0.6);
  EXPECT_LT(sum / kDraws / 17, 1.6);
  RecordProperty("mahalanobis", std::to_string(sum / kDraws / 17));
}

TEST(KeypointRefine, OptionsAreChecked) {
  const geometry::Rig rig = PeopleRig(3);
  KeypointRefineOptions options;
  options.choice.num_folds = 1;
  EXPECT_THROW(RefineFromKeypoints(rig, {}, {}, {}, {}, options), UsageError);
  EXPECT_THROW(RefineFromKeypoints(rig, FilmPeople(rig, Take(12)), {}, FrameChoice{0, 2}, FrameChoice{0, 4}, {}), UsageError);
}

TEST(KeypointRefine, ThreadsDoNotMatter) {
  const geometry::Rig truth = PeopleRig(3);
  const geometry::Rig start = testing::Disturbed(truth, 0.02, 0.05, 2);
  RunContext one, two;
  one.num_threads = 1, two.num_threads = 2;
  const auto frames = FilmPeople(truth, Take(16));
  const auto a = RefineFromKeypoints(start, frames, {}, {}, {}, PosesOnly(), one);
  const auto b = RefineFromKeypoints(start, frames, {}, {}, {}, PosesOnly(), two);
  for (size_t c = 0; c < 3; ++c)
    EXPECT_EQ(a.rig.cameras[c].cam_from_world.translation, b.rig.cameras[c].cam_from_world.translation);
}

/// Cameras of a lab whose marker-based calibration is off by some tenths of a degree; a person balancing (Pose2Sim's demo).
class KeypointRefinePose2Sim : public ::testing::Test {
 protected:
  void SetUp() override {
    MVS_NEEDS_DATA("pose2sim");
    const std::string root = mvstudio::testing::DataRoot() + "/pose2sim";
    rig_ = ReadToml(root + "/calibration/Calib_qualisys.toml").rig;
    std::map<int, triangulate::DetectedFrame> frames;
    const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25b");
    for (size_t c = 0; c < 4; ++c) {
      const std::string folder = root + "/balancing/pose-associated/cam0" + std::to_string(c + 1) + "_json";
      for (const auto& [number, people] : dataset::ReadOpenPoseFolder(folder, rig_.cameras[c].camera.name, skeleton).frames) {
        frames[number].frame = number;
        frames[number].people.resize(4);
        for (const auto& person : people) {
          auto& detected = frames[number].people[c].emplace_back();
          for (const auto& key : person.keypoints) detected.push_back({{key.x_px, key.y_px}, key.score});
        }
      }
    }
    for (auto& [number, frame] : frames) frames_.push_back(frame);
    for (const std::string side : {"L", "R"})
      for (const auto& [a, b] : {std::pair("Shoulder", "Elbow"), {"Elbow", "Wrist"}, {"Hip", "Knee"}, {"Knee", "Ankle"}})
        limbs_.emplace_back(skeleton.Find(side + a), skeleton.Find(side + b));
  }
  geometry::Rig rig_;
  std::vector<triangulate::DetectedFrame> frames_;
  std::vector<std::pair<int, int>> limbs_;
};

/// Another program, adjusting the four poses on these frames, went from 6.69 to 3.97 px (median) and to 19.6 mm.
TEST_F(KeypointRefinePose2Sim, BeatsTheReference) {
  const auto report = RefineFromKeypoints(rig_, frames_, limbs_, FrameChoice{0, 4}, FrameChoice{2, 4}, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.before.median_px, 6.69, 0.1);
  EXPECT_LE(report.after.median_px, 3.97);
  EXPECT_LE(report.after.limb_std_mm, 19.6);
  EXPECT_EQ(report.before.num_joints, report.after.num_joints);  // no view and no joint is dropped
  EXPECT_NEAR(report.after.limb_mean_mm, report.before.limb_mean_mm, 0.02 * report.before.limb_mean_mm);
}

TEST_F(KeypointRefinePose2Sim, ABadStartEndsAtTheSamePlace) {
  const geometry::Rig start = testing::Disturbed(rig_, 0.05, 0.15, 3);
  const auto report = RefineFromKeypoints(start, frames_, limbs_, FrameChoice{0, 4}, FrameChoice{2, 4}, PosesOnly());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_GT(report.before.median_px, 20);
  EXPECT_LE(report.after.median_px, 3.97);
}

/// The base has poses alone adjusted: its own lenses are true to some tenths of a per cent.
TEST_F(KeypointRefinePose2Sim, NamesTheCamera) {
  constexpr double kBaseError = 0.002;
  const geometry::Rig base = RefineFromKeypoints(rig_, frames_, limbs_, FrameChoice{0, 2}, FrameChoice{1, 2}, PosesOnly()).rig;
  geometry::Rig rotated = base, focal = base;
  testing::Bump({0, kPi / 180, 0}, {0, 0, 0}, &rotated.cameras[1]);
  const auto first = RefineFromKeypoints(rotated, frames_, limbs_, FrameChoice{1, 2}, FrameChoice{0, 2}, PosesOnly());
  EXPECT_EQ(first.suspect.fault, CameraFault::kPose) << first.suspect.message;
  EXPECT_EQ(first.suspect.camera_idx, 1);
  EXPECT_NEAR(first.suspect.rotation_rad, kPi / 180, 3 * first.suspect.rotation_sigma_rad);

  auto scaled = frames_;
  for (auto& frame : scaled)
    for (auto& person : frame.people[3])
      for (auto& key : person) key.px.x() = (key.px.x() + 0.5) * 1080 / 1088 - 0.5;
  const auto second = RefineFromKeypoints(base, scaled, limbs_, FrameChoice{1, 2}, FrameChoice{0, 2}, PosesOnly());
  EXPECT_EQ(second.suspect.fault, CameraFault::kImageWidth) << second.suspect.message;
  EXPECT_EQ(second.suspect.camera_idx, 3);
  EXPECT_NEAR(second.suspect.scale, 1080.0 / 1088, 3 * second.suspect.scale_sigma + kBaseError);

  focal.cameras[2].camera.params.head<2>() *= 1.02;
  const auto third = RefineFromKeypoints(focal, frames_, limbs_, FrameChoice{1, 2}, FrameChoice{0, 2}, PosesOnly());
  EXPECT_EQ(third.suspect.fault, CameraFault::kFocal) << third.suspect.message;
  EXPECT_EQ(third.suspect.camera_idx, 2);
  EXPECT_NEAR(third.suspect.scale, 1 / 1.02, 3 * third.suspect.scale_sigma + kBaseError);
}

}  // namespace
}  // namespace mvstudio::calib
