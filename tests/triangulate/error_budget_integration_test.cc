#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "geometry/rig/rig_covariance.h"
#include "geometry/rigid/rigid3.h"
#include "tests/triangulate/support.h"
#include "triangulate/budget/budget.h"
#include "triangulate/budget/reliability.h"
#include "triangulate/budget/stated.h"
#include "triangulate/budget/whiten.h"

/// A studio with exact truth, spoiled in one stage at a time: the stage is named, and the camera.
namespace mvstudio::triangulate {
namespace {

constexpr int kBudgetFrames = 40, kBudgetJoints = 14;
constexpr double kBudgetNoisePx = 0.05;

/// Pairs of joints on both sides of a body that turns and moves, metres.
Eigen::Vector3d TrueJointAt(int joint, double frame) {
  const double t = frame / 30, side = joint % 2 ? 0.18 : -0.18, turn = 0.8 * t;
  const Eigen::Vector3d own(side + 0.05 * std::sin(3 * t + joint),
                            0.2 * std::sin(1.3 * joint) + 0.2 * std::sin(2.6 * t + joint),
                            0.1 * (joint / 2) - 0.3 + 0.1 * std::sin(3.7 * t + 2 * joint));
  return Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()) * own + Eigen::Vector3d(0.2 * std::sin(2.1 * t), 0, 0);
}

struct BudgetStudio {
  BudgetTake take;
  BudgetTruth truth;
};

BudgetStudio MakeBudgetStudio(int num_cameras, double noise_px,
                              const std::vector<double>& late_frames = std::vector<double>(6)) {
  BudgetStudio studio;
  MirrorGroups mirror(1);
  for (int j = 0; j < kBudgetJoints; j += 2) mirror[0].push_back({j, j + 1});
  studio.truth.rig = studio.take.rig = MakeRing(num_cameras);
  studio.truth.offset_frames.assign(static_cast<size_t>(num_cameras), 0);
  studio.take.clocks.resize(static_cast<size_t>(num_cameras));
  studio.take.sigma_frames.assign(static_cast<size_t>(num_cameras), std::nan(""));
  studio.take.body = TakeBody(kBudgetJoints, mirror);
  Rng rng(5);
  for (int f = -2; f < kBudgetFrames + 2; ++f) {
    TruePeople people(1);
    for (int j = 0; j < kBudgetJoints; ++j) people[0].push_back(TrueJointAt(j, f));
    studio.truth.people[f] = people;
    DetectedFrame frame{f, {}};
    for (int c = 0; c < num_cameras; ++c) {
      DetectedPerson person;
      for (int j = 0; j < kBudgetJoints; ++j) {
        const geometry::RigCamera& camera = studio.truth.rig.cameras[static_cast<size_t>(c)];
        const Eigen::Vector3d x = TrueJointAt(j, f - late_frames[static_cast<size_t>(c)]);
        person.push_back({geometry::Project(camera.camera, camera.cam_from_world * x).px +
                              noise_px * Eigen::Vector2d(rng.Normal(), rng.Normal()),
                          0.9});
      }
      frame.people.push_back({person});
    }
    if (f >= 0 && f < kBudgetFrames) studio.take.frames.push_back(frame);
  }
  for (int c = 0; c < num_cameras; ++c)
    studio.truth.offset_frames[static_cast<size_t>(c)] = late_frames[static_cast<size_t>(c)];
  return studio;
}

void TurnCamera(BudgetTake* take, size_t camera, double deg) {
  geometry::Rigid3& pose = take->rig.cameras[camera].cam_from_world;
  pose = geometry::Rigid3{geometry::RotationExp({0, DegToRad(deg), 0})} * pose;  // about its own centre
}

struct SpoiledStage {
  const char* what;
  std::function<void(BudgetStudio*)> spoil;
  BudgetStage stage;
  int camera;  ///< -1: several
};

std::vector<SpoiledStage> EightSpoiledStages() {
  const auto each = [](BudgetStudio* s, const auto& change) {
    Rng rng(9);
    for (size_t f = 0; f < s->take.frames.size(); ++f) {
      for (size_t c = 0; c < 6; ++c) change(f, c, &s->take.frames[f].people[c], &rng);
    }
  };
  const auto move = [](DetectedPerson* person, const std::function<Eigen::Vector2d()>& by) {
    for (Keypoint& key : *person) key.px += by();
  };
  return {
      {"a camera turned by 0.2 degrees", [](BudgetStudio* s) { TurnCamera(&s->take, 2, 0.2); }, BudgetStage::kCalibration, 2},
      {"a focal length 1 % off", [](BudgetStudio* s) { s->take.rig.cameras[4].camera.params.head<2>() *= 1.01; },
       BudgetStage::kCalibration, 4},
      {"a lens term missing in all cameras",
       [](BudgetStudio* s) {
         for (auto& c : s->take.rig.cameras) c.camera.params[4] = 0;
       },
       BudgetStage::kCalibration, -1},
      {"1.5 px of bias in a camera",
       [=](BudgetStudio* s) {
         each(s, [&](size_t, size_t c, auto* people, Rng*) {
           if (c == 3) move(&people->front(), [] { return Eigen::Vector2d(1.5, 0); });
         });
       },
       BudgetStage::kJoints2d, 3},
      {"3 px of noise in a camera",
       [=](BudgetStudio* s) {
         each(s, [&](size_t, size_t c, auto* people, Rng* rng) {
           if (c == 5)
             move(&people->front(), [&]() -> Eigen::Vector2d { return 3 * Eigen::Vector2d(rng->Normal(), rng->Normal()); });
         });
       },
       BudgetStage::kJoints2d, -1},
      {"a camera 0.4 frames late",
       [](BudgetStudio* s) {
         *s = MakeBudgetStudio(6, kBudgetNoisePx, {0, 0.4, 0, 0, 0, 0});
       },
       BudgetStage::kSync, 1},
      {"left and right exchanged in most cameras",
       [=](BudgetStudio* s) {
         each(s, [&](size_t f, size_t c, auto* people, Rng*) {
           for (size_t j = 0; f % 5 == 0 && c < 4 && j < kBudgetJoints; j += 2)
             std::swap(people->front()[j], people->front()[j + 1]);
         });
       },
       BudgetStage::kPeople, -1},
      {"people dropped from 70 % of the images",
       [=](BudgetStudio* s) {
         each(s, [&](size_t f, size_t, auto* people, Rng* rng) {
           if (f > 0 && f + 1 < kBudgetFrames && rng->Uniform() < 0.7) people->clear();
         });
       },
       BudgetStage::kPeople, -1},
  };
}

TEST(ErrorBudget, EightSpoiledStagesAreNamedAndMendingBringsWhatWasSaid) {
  const BudgetStudio sound = MakeBudgetStudio(6, kBudgetNoisePx);
  const ErrorBudget mended = MeasureBudget(sound.take, sound.truth);
  for (const SpoiledStage& spoiled : EightSpoiledStages()) {
    SCOPED_TRACE(spoiled.what);
    BudgetStudio studio = MakeBudgetStudio(6, kBudgetNoisePx);
    spoiled.spoil(&studio);
    const ErrorBudget budget = MeasureBudget(studio.take, studio.truth);
    EXPECT_EQ(ToString(budget.next), ToString(spoiled.stage));
    const auto& gains = budget.next_by_camera;
    ASSERT_EQ(gains.size(), 6u);
    const double would = spoiled.camera >= 0 ? gains[static_cast<size_t>(spoiled.camera)]
                                             : budget.Measure(budget.next_by).stages[static_cast<size_t>(budget.next)].alone;
    const double did = budget.Measure(budget.next_by).now - mended.Measure(budget.next_by).now;
    EXPECT_NEAR(would, did, 0.15 * did);
    if (spoiled.camera >= 0) {
      EXPECT_EQ(std::max_element(gains.begin(), gains.end()) - gains.begin(), spoiled.camera);
    }
    for (const BudgetMeasure* each : {&budget.joints_mm, &budget.held_out_px, &budget.missing}) {
      double sum = each->rest;
      for (const BudgetShare& share : each->stages) sum += share.share;
      EXPECT_NEAR(sum, each->now, 1e-9 * std::max(1.0, each->now));
    }
    EXPECT_LT(budget.joints_mm.rest, 0.05);
  }
}

TEST(ErrorBudget, SaysWhichPartOfACalibrationIsWrong) {
  BudgetStudio rotated = MakeBudgetStudio(6, kBudgetNoisePx), longer = MakeBudgetStudio(6, kBudgetNoisePx);
  TurnCamera(&rotated.take, 2, 0.2);
  longer.take.rig.cameras[4].camera.params.head<2>() *= 1.01;
  const ErrorBudget pose = MeasureBudget(rotated.take, rotated.truth), lens = MeasureBudget(longer.take, longer.truth);
  EXPECT_GT(pose.pose_alone, 3 * pose.lens_alone);
  EXPECT_GT(lens.lens_alone, 3 * lens.pose_alone);
  EXPECT_NEAR(pose.cameras[2].rotation_deg, 0.2, 0.05);  // a little goes into the best motion of the rig
  EXPECT_GT(lens.cameras[4].lens_px, 2);
}

TEST(ErrorBudget, NeitherAWorldNorACommonClockIsAnError) {
  BudgetStudio studio = MakeBudgetStudio(4, 0);
  const geometry::Rigid3 moved = geometry::Perturb((geometry::Vector6d() << 0.3, 0.1, 1, 2, -1, 0.5).finished(), {});
  for (auto& camera : studio.take.rig.cameras) camera.cam_from_world = camera.cam_from_world * moved;
  for (Clock& clock : studio.take.clocks) clock.offset_frames = 7;
  const ErrorBudget budget = MeasureBudget(studio.take, studio.truth);
  EXPECT_GT(budget.joints_mm.num, 500);
  EXPECT_LT(budget.joints_mm.now, 1e-3);
  EXPECT_LT(budget.held_out_px.now, 1e-3);
}

TEST(ErrorBudget, TwoPeopleKeepTheirNames) {
  BudgetStudio one = MakeBudgetStudio(5, 0.3);
  for (auto& [step, people] : one.truth.people) {
    people.push_back(people[0]);
    for (auto& x : people[1]) *x += Eigen::Vector3d(0.9, 0.3, 0);
  }
  Rng rng(3);
  for (DetectedFrame& frame : one.take.frames) {
    for (size_t c = 0; c < frame.people.size(); ++c) {
      const geometry::RigCamera& camera = one.truth.rig.cameras[c];
      DetectedPerson other;
      for (const auto& x : one.truth.people[frame.frame][1])
        other.push_back({geometry::Project(camera.camera, camera.cam_from_world * *x).px +
                             0.3 * Eigen::Vector2d(rng.Normal(), rng.Normal()),
                         0.9});
      frame.people[c].insert(frame.people[c].begin() + (c % 2), other);
    }
  }
  const ErrorBudget budget = MeasureBudget(one.take, one.truth);
  EXPECT_EQ(budget.joints_mm.num, 2 * kBudgetJoints * kBudgetFrames);
  EXPECT_EQ(ToString(budget.next), "2D joints");
  EXPECT_LT(budget.joints_mm.now, 1);
  EXPECT_EQ(budget.cameras[0].num_people, 2 * kBudgetFrames);
}

TEST(Whitened, SigmasHalfAsLargeAsTheNoiseAreTooSureByTwo) {
  BudgetStudio studio = MakeBudgetStudio(6, 1);
  studio.take.options.calibration_covariance = false;
  for (const double sigma_px : {1.0, 0.5}) {
    studio.take.options.sigma_px = sigma_px;
    studio.take.options.max_residual_sigmas = 100;  // no view is left out for its noise
    const WhitenedJoints joints = WhitenJoints(studio.take, studio.truth);
    EXPECT_TRUE(joints.with_rig.empty());
    const Reliability detected = MeasureReliability(joints.detected, 1), solved = MeasureReliability(joints.without_rig, 3);
    EXPECT_EQ(detected.num, 2 * 6 * kBudgetJoints * kBudgetFrames);
    EXPECT_EQ(solved.num, kBudgetJoints * kBudgetFrames);
    EXPECT_NEAR(detected.sigma_factor, 1 / sigma_px, 0.1 / sigma_px);
    EXPECT_NEAR(solved.sigma_factor, 1 / sigma_px, 0.12 / sigma_px);
    if (sigma_px == 1) {
      EXPECT_LT(std::max(detected.error, solved.error), 0.05);
    } else {
      EXPECT_GT(std::min(detected.error, solved.error), 0.15);
    }
  }
}

TEST(Whitened, OffsetsCountFromTheReference) {
  BudgetStudio studio = MakeBudgetStudio(3, 0);
  studio.take.clocks = {{5, 1}, {5.3, 1}, {4.9, 1}};
  EXPECT_TRUE(WhitenedOffsets(studio.take, studio.truth).empty());
  studio.take.sigma_frames = {0, 0.1, std::nan("")};
  studio.truth.offset_frames = {1, 1.1, 1};
  const std::vector<double> squared = WhitenedOffsets(studio.take, studio.truth);
  ASSERT_EQ(squared.size(), 1u);
  EXPECT_NEAR(squared[0], 4, 1e-9);  // 0.3 - 0.1 of 0.1
}

/// The rig with an error of its stated size, or without an error that is stated.
geometry::Rig WithCovariance(geometry::Rig rig, double rotation_rad) {
  const Eigen::VectorXd sigmas =
      (Eigen::VectorXd(6) << Eigen::Vector3d::Constant(rotation_rad), Eigen::Vector3d::Constant(3 * rotation_rad)).finished();
  for (auto& camera : rig.cameras) {
    camera.cam_from_world_covariance = Eigen::MatrixXd(sigmas.cwiseAbs2().asDiagonal());
    camera.params_covariance = Eigen::MatrixXd::Zero(9, 9);
  }
  return rig;
}

/// Rigs that err as they state, their world fixed by their first camera: its own error is one of all others. Fitted onto the
/// truth by all cameras, they would err less than they state.
TEST(Whitened, JointsOfRigsThatErrAsStatedAreTrueInAnyWorld) {
  BudgetStudio studio = MakeBudgetStudio(5, kBudgetNoisePx);
  studio.take.options.sigma_px = kBudgetNoisePx, studio.take.options.max_residual_sigmas = 1000;
  studio.take.frames.resize(3);
  const geometry::Rig stated = WithCovariance(studio.truth.rig, 3e-4);
  const geometry::Rigid3 other_from_first{geometry::RotationExp({0.3, -0.7, 1.1}), {2, -1, 0.5}};
  Rng rng(8);
  std::vector<double> with_rig;
  for (int draw = 0; draw < 40; ++draw) {
    studio.take.rig = InWorld(RelativeToFirst(DrawRig(stated, &rng)), other_from_first);
    const WhitenedJoints joints = WhitenJoints(studio.take, studio.truth);
    with_rig.insert(with_rig.end(), joints.with_rig.begin(), joints.with_rig.end());
  }
  const Reliability is = MeasureReliability(with_rig, 3);
  std::printf("joints of 40 rigs: %d, calibration error %.3f, sigmas should grow by %.2f\n", is.num, is.error, is.sigma_factor);
  EXPECT_GT(is.num, 1500);
  EXPECT_LT(is.error, 0.05);
  EXPECT_NEAR(is.sigma_factor, 1, 0.12);
}

TEST(StatedBudget, NoiseThatIsStatedIsTheWholeError) {
  const BudgetStudio studio = MakeBudgetStudio(6, 1);
  const StatedBudget budget = MeasureStatedBudget(studio.take, 8);
  ASSERT_EQ(budget.stages.size(), 3u);
  EXPECT_FALSE(budget.stages[0].stated);
  EXPECT_FALSE(budget.stages[1].stated);
  EXPECT_TRUE(budget.stages[2].stated);
  EXPECT_NEAR(budget.stages[2].share_px2 / budget.mean_px2, 1, 0.1);
  EXPECT_LT(std::abs(budget.rest_px2), 0.12 * budget.mean_px2);
  EXPECT_LT(budget.shifts_px2, 0.1 * budget.mean_px2);
}

TEST(StatedBudget, AShiftThatNoSigmaStatesIsTheRestAndHasACamera) {
  BudgetStudio studio = MakeBudgetStudio(6, kBudgetNoisePx);
  TurnCamera(&studio.take, 2, 0.2);
  const StatedBudget budget = MeasureStatedBudget(studio.take, 4);
  EXPECT_GT(budget.rest_px2, 0.6 * budget.mean_px2);
  size_t most = 0;
  for (size_t c = 0; c < 6; ++c) {
    if (budget.cameras[c].share_px2 > budget.cameras[most].share_px2) most = c;
  }
  EXPECT_EQ(most, 2u);
  EXPECT_NEAR(std::abs(budget.cameras[2].shift_px.x()), 1000 * DegToRad(0.2), 0.7);
}

TEST(StatedBudget, ACalibrationIsAsLargeAPartAsItsCovarianceSays) {
  BudgetStudio studio = MakeBudgetStudio(6, kBudgetNoisePx);
  Rng rng(21);
  studio.take.options.sigma_px = kBudgetNoisePx;   // the estimate holds what of the rig looks like noise
  studio.take.options.max_residual_sigmas = 1000;  // no view is left out for the rig
  studio.take.rig = DrawRig(WithCovariance(studio.truth.rig, 1e-3), &rng);
  const StatedBudget budget = MeasureStatedBudget(studio.take, 8);
  EXPECT_GT(budget.stages[0].share_px2, 0.4 * budget.mean_px2);  // one rig's error against the mean of eight
  EXPECT_LT(budget.stages[0].share_px2, 2.5 * budget.mean_px2);
  EXPECT_GT(budget.stages[0].share_px2, 5 * budget.stages[2].share_px2);
  EXPECT_GT(budget.stages[0].moved_mm, 1);
}

}  // namespace
}  // namespace mvstudio::triangulate
