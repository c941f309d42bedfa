#include <ATen/ATen.h>

#include <Eigen/Geometry>
#include <cmath>

#include "avatar/run/lift/lift_take.h"
#include "core/error.h"
#include "core/units.h"
#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"
#include "tests/support/one_thread.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::testing {
namespace {

using namespace avatar;
using dataset::Coco19Pose;
using Eigen::Vector3d;

/// A person of 0.9 m trunk + leg who stands at the origin (z up, looks along -y) with raised, swinging arms.
Coco19Pose Standing(double phase) {
  Coco19Pose pose;
  pose.valid.fill(true);
  const double swing = 0.4 * std::sin(phase);
  auto& x = pose.x_in_world;
  x.col(2) << 0, 0, 0.9;
  x.col(0) << 0, 0, 1.4;
  x.col(1) << 0, -0.1, 1.55;
  for (const int side : {1, -1}) {  // left is +x
    const int arm = side > 0 ? 3 : 9, leg = side > 0 ? 6 : 12, eye = side > 0 ? 15 : 17;
    x.col(arm) << side * 0.2, 0, 1.4;
    x.col(arm + 1) = x.col(arm) + 0.3 * Vector3d(side * std::cos(swing), -std::sin(swing), -0.3).normalized();
    x.col(arm + 2) = x.col(arm + 1) + 0.25 * Vector3d(side * 0.2, -std::cos(2 * swing), std::sin(2 * swing)).normalized();
    x.col(leg) << side * 0.1, 0, 0.9;
    x.col(leg + 1) << side * 0.12, -0.1 * swing, 0.5;
    x.col(leg + 2) << side * 0.12, 0.2 * swing, 0.1;
    x.col(eye) << side * 0.03, -0.08, 1.6;
    x.col(eye + 1) << side * 0.07, 0, 1.58;
  }
  return pose;
}

LiftSequence Sequence(int frames) {
  LiftSequence s;
  s.name = "standing";
  for (int f = 0; f < frames; ++f) {
    s.frames.push_back(Standing(0.3 * f));
    s.middle.push_back(f);
  }
  s.size_m = MedianSize(s.frames);
  return s;
}

/// A pinhole 3 m in front of the person and a little above, rolled about its axis.
geometry::RigCamera CameraInFront(double roll_deg) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", 640, 480, 600);
  const Vector3d centre(0.5, -3, 1.8), z = (Vector3d(0, 0, 0.9) - centre).normalized();
  Eigen::Matrix3d m;
  m.row(2) = z;
  m.row(0) = Vector3d(0, 0, -1).cross(z).normalized();
  m.row(1) = z.cross(Vector3d(m.row(0)));
  m = Eigen::AngleAxisd(DegToRad(roll_deg), Vector3d::UnitZ()) * m;
  camera.cam_from_world.rotation = Eigen::Quaterniond(m);
  camera.cam_from_world.translation = -(m * centre);
  return camera;
}

LiftView See(const Coco19Pose& pose, const geometry::RigCamera& camera) {
  LiftView view;
  for (int j = 0; j < kLiftJoints; ++j) {
    view.ray_in_cam.col(j) = camera.cam_from_world * pose.x_in_world.col(j);
    view.score[j] = 1;
  }
  return view;
}

std::array<LiftView, kLiftWindow> Window(const geometry::RigCamera& camera) {
  std::array<LiftView, kLiftWindow> window;
  for (int f = 0; f < kLiftWindow; ++f) window[f] = See(Standing(0.3 * f), camera);
  return window;
}

Vector3d Up(const geometry::RigCamera& camera) { return camera.cam_from_world.rotation * Vector3d::UnitZ(); }

TEST(LiftInput, NeitherRollNorDirectionOfTheCameraAreLeft) {
  const geometry::RigCamera straight = CameraInFront(0);
  const LiftInput a = MakeLiftInput(Window(straight), Up(straight));
  ASSERT_EQ(a.status, Status::kOk);
  ASSERT_EQ(static_cast<int64_t>(a.values.size()), kLiftInputs);
  for (const double roll : {35.0, 90.0, -170.0}) {
    geometry::RigCamera rotated = CameraInFront(roll);  // and looks past the person
    rotated.cam_from_world = geometry::Rigid3{geometry::RotationExp({0.1, -0.2, 0}), Vector3d::Zero()} * rotated.cam_from_world;
    const LiftInput b = MakeLiftInput(Window(rotated), Up(rotated));
    ASSERT_EQ(b.status, Status::kOk);
    for (size_t i = 0; i < a.values.size(); ++i) EXPECT_NEAR(a.values[i], b.values[i], 1e-5) << i;
    const LiftJoints x = (rotated.cam_from_world.rotation * straight.cam_from_world.rotation.conjugate()).toRotationMatrix() *
                         a.cam_from_view * LiftJoints::Identity();
    EXPECT_LT((x - b.cam_from_view * LiftJoints::Identity()).norm(), 1e-9);
  }
}

TEST(LiftInput, ReasonsForARefusal) {
  const geometry::RigCamera camera = CameraInFront(0);
  const auto status = [&](auto&& change) {
    auto window = Window(camera);
    change(window);
    return MakeLiftInput(window, Up(camera)).status;
  };
  EXPECT_EQ(status([](auto&) {}), Status::kOk);
  EXPECT_EQ(status([](auto& w) { w[2] = LiftView(); }), Status::kTooFewViews);
  EXPECT_EQ(status([](auto& w) { std::fill(w[2].score.begin() + 5, w[2].score.end(), 0.0); }), Status::kTooFewViews);
  EXPECT_EQ(status([](auto& w) { w[2].ray_in_cam(1, 4) = std::nan(""); }), Status::kNonFiniteInput);
  EXPECT_EQ(status([](auto& w) { w[2].score[4] = std::nan(""); }), Status::kNonFiniteInput);
  EXPECT_EQ(status([](auto& w) { w[2].ray_in_cam(1, 4) = std::nan(""), w[2].score[4] = 0; }), Status::kOk);
  EXPECT_EQ(status([](auto& w) { w[0].ray_in_cam(1, 4) = std::nan(""); }), Status::kOk);  // counts as a missing frame
  EXPECT_EQ(status([](auto& w) { w[0] = w[1] = w[3] = w[4] = LiftView(); }), Status::kOk);
  EXPECT_EQ(status([](auto& w) {
              for (LiftView& v : w) v.ray_in_cam.colwise() = Eigen::Vector3d(0.1, 0.2, 1);
            }),
            Status::kDegenerate);
  EXPECT_EQ(status([](auto& w) {  // one joint in each direction of space
              w[2].score.fill(0);
              for (int j = 0; j < 6; ++j) w[2].score[j] = 1, w[2].ray_in_cam.col(j) = (j % 2 ? -1 : 1) * Vector3d::Unit(j / 2);
              w[2].ray_in_cam(1, 0) = 0.1;
            }),
            Status::kBehindCamera);
}

TEST(PlaceInView, FindsTheExactPlaceAndScalesWithTheSize) {
  const geometry::RigCamera camera = CameraInFront(20);
  const LiftInput input = MakeLiftInput(Window(camera), Up(camera));
  const Coco19Pose pose = Standing(0.6);
  LiftJoints truth;
  for (int j = 0; j < kLiftJoints; ++j) {
    truth.col(j) = input.cam_from_view.transpose() * (camera.cam_from_world * pose.x_in_world.col(j));
  }
  const LiftJoints x = truth.colwise() - Vector3d(truth.col(2));
  const LiftPlacement place = PlaceInView(x, input.xy_in_view, input.score);
  ASSERT_EQ(place.status, Status::kOk);
  EXPECT_LT((place.root_in_view - truth.col(2)).norm(), 1e-9);
  EXPECT_LT(place.rms, 1e-12);
  const LiftPlacement twice = PlaceInView(2 * x, input.xy_in_view, input.score);  // the ambiguity of one camera
  EXPECT_LT((twice.root_in_view - 2 * place.root_in_view).norm(), 1e-9);
  EXPECT_LT(twice.rms, 1e-12);
  std::array<double, kLiftJoints> few = input.score;
  std::fill(few.begin() + 5, few.end(), 0.0);
  EXPECT_EQ(PlaceInView(x, input.xy_in_view, few).status, Status::kTooFewViews);
  EXPECT_EQ(PlaceInView(x, input.xy_in_view * 0, input.score).status, Status::kDegenerate);
  EXPECT_EQ(PlaceInView(-x, input.xy_in_view, input.score).status, Status::kBehindCamera);
  EXPECT_EQ(PlaceInView(x * std::nan(""), input.xy_in_view, input.score).status, Status::kNonFiniteInput);
}

TEST(PlaceInView, IsTheMinimumOfItsSum) {
  const geometry::RigCamera camera = CameraInFront(0);
  const LiftInput input = MakeLiftInput(Window(camera), Up(camera));
  Rng rng(3);
  LiftJoints x;
  std::array<double, kLiftJoints> score;
  for (int j = 0; j < kLiftJoints; ++j) {
    score[j] = rng.Uniform(0.2, 1);
    x.col(j) = input.cam_from_view.transpose() *
               (camera.cam_from_world.rotation * (Standing(0.6).x_in_world.col(j) - Vector3d(0, 0, 0.9)));
    x.col(j) += 0.03 * Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
  }
  const auto sum = [&](const Vector3d& t) {
    double total = 0;
    for (int j = 0; j < kLiftJoints; ++j) {
      const Vector3d p = x.col(j) + t;
      total += score[j] * (p.head<2>() - p.z() * input.xy_in_view.col(j)).squaredNorm();
    }
    return total;
  };
  const LiftPlacement place = PlaceInView(x, input.xy_in_view, score);
  ASSERT_EQ(place.status, Status::kOk);
  for (int k = 0; k < 3; ++k) {
    const Vector3d step = 1e-5 * Vector3d::Unit(k);
    EXPECT_NEAR((sum(place.root_in_view + step) - sum(place.root_in_view - step)) / 2e-5, 0, 1e-8) << k;
    EXPECT_GT(sum(place.root_in_view + 100 * step), sum(place.root_in_view)) << k;
  }
}

TEST(LiftSamples, RotatedLimbsKeepTheirLengthsAndTargetsFitTheirViews) {
  const std::vector<LiftSequence> sequences = {Sequence(20)};
  LiftSampleOptions options;
  options.noise = options.bias = options.drop = 0;
  Rng rng(5);
  const double forearm = (Standing(0).x_in_world.col(4) - Standing(0).x_in_world.col(5)).norm() / sequences[0].size_m;
  for (int i = 0; i < 50; ++i) {
    const LiftSample s = RandomSample(sequences, options, rng);
    EXPECT_NEAR((s.target.col(4) - s.target.col(5)).norm(), forearm, 1e-9);
    EXPECT_NEAR((s.target.col(10) - s.target.col(11)).norm(), forearm, 1e-9);
    EXPECT_LT(s.target.col(2).norm(), 1e-12);
    const LiftPlacement place = PlaceInView(s.target, s.input.xy_in_view, s.input.score);  // exact up to the levelling error
    ASSERT_EQ(place.status, Status::kOk);
    EXPECT_LT(place.rms, 1e-9);
    EXPECT_GT(place.root_in_view.z(), 0.9 * options.min_distance);
    EXPECT_LT(place.root_in_view.z(), 1.1 * options.max_distance);
  }
}

TEST(ScoreLift, ClosedForms) {
  LiftPair pair;
  pair.valid.fill(true);
  pair.truth = Standing(0.2).x_in_world;
  pair.x = pair.truth.colwise() + Vector3d(0, 0, 0.5);
  LiftScore s = ScoreLift({{pair}}, true);
  EXPECT_NEAR(s.mpjpe_mm, 0, 1e-9);
  EXPECT_NEAR(s.root_mm, 500, 1e-9);
  EXPECT_TRUE(std::isnan(s.acceleration_mm));
  const Eigen::Matrix3d turn = geometry::RotationExp({0.2, 0.5, -0.1}).toRotationMatrix();
  pair.x = 1.3 * turn * pair.truth;
  s = ScoreLift({{pair}}, false);
  EXPECT_GT(s.mpjpe_mm, 100);
  EXPECT_NEAR(s.procrustes_mpjpe_mm, 0, 1e-6);
  EXPECT_TRUE(std::isnan(s.root_mm));
  pair.x = 1.3 * pair.truth;
  EXPECT_NEAR(ScoreLift({{pair}}, false).scaled_mpjpe_mm, 0, 1e-9);
  std::vector<LiftPair> falling;  // joints but the root fall: second difference 2 mm a frame^2
  for (int f = 0; f < 6; ++f) {
    pair.frame = f, pair.x = pair.truth.colwise() + Vector3d(0, 0, 0.001 * f * f);
    pair.x.col(2) = pair.truth.col(2);
    falling.push_back(pair);
  }
  s = ScoreLift({falling}, true);
  EXPECT_NEAR(s.acceleration_mm, 2, 1e-9);
  EXPECT_NEAR(s.true_acceleration_mm, 0, 1e-9);
}

LiftOptions Tiny(int steps) {
  LiftOptions o;
  o.width = 64, o.blocks = 1, o.steps = steps, o.batch = 32, o.learning_rate = 3e-3;
  return o;
}

TEST(Lifter, TrainingGivesTheSameBytesAgainAndARateOfZeroChangesNothing) {
  const auto sampler = SamplerOf({Sequence(10)}, {}, 7);
  Lifter a = MakeLifter(Tiny(5), 1), b = MakeLifter(Tiny(5), 1), fresh = MakeLifter(Tiny(5), 1), still = MakeLifter(Tiny(5), 1);
  still.options.learning_rate = 0;
  TrainLifter(sampler, OneThread(), &a);
  TrainLifter(sampler, OneThread(), &b);
  TrainLifter(sampler, OneThread(), &still);
  for (const auto& [name, weight] : a.weights) {
    EXPECT_TRUE(at::equal(weight, b.weights.at(name))) << name;
    EXPECT_TRUE(at::equal(fresh.weights.at(name), still.weights.at(name))) << name;
    EXPECT_FALSE(at::equal(weight, fresh.weights.at(name))) << name;
  }
}

TEST(Lifter, LearnsToLiftWhatItHasSeenBetterThanTheMeanPose) {
  const std::vector<LiftSequence> sequences = {Sequence(21)};
  LiftSampleOptions options;
  options.pose_jitter_deg = 5;
  Lifter lifter = MakeLifter(Tiny(150), 1);
  lifter.size_m = sequences[0].size_m;
  const LiftReport report = TrainLifter(SamplerOf(sequences, options, 1), OneThread(), &lifter);
  ASSERT_EQ(report.status, Status::kOk);
  EXPECT_LT(report.losses.back().second, 0.8 * report.losses.front().second);
  const geometry::RigCamera camera = CameraInFront(40);
  std::map<int, LiftView> views;
  std::map<int, Coco19Pose> truth;
  for (int f = 0; f < 20; ++f) truth[f] = Standing(0.3 * f + 0.15), views[f] = See(truth[f], camera);
  const LiftBaselines baselines(sequences, options, 100, 1);
  const LiftComparison c = CompareOnTake(lifter, baselines, LiftInputs(views, 1, Up(camera)), truth, camera);
  EXPECT_EQ(c.lifter.frames, 20);
  EXPECT_LT(c.lifter.mpjpe_mm, 0.6 * c.mean_pose.mpjpe_mm);
  EXPECT_LT(c.lifter.root_mm, 300);
}

TEST(Lifter, FramesWithoutJointsAreRefusedEachByItself) {
  Lifter lifter = MakeLifter(Tiny(0), 1);
  const geometry::RigCamera camera = CameraInFront(0);
  std::map<int, LiftView> views = {{3, LiftView()}, {4, See(Standing(0), camera)}, {5, LiftView()}};
  views[5].score.fill(1), views[5].ray_in_cam.setConstant(std::nan(""));
  const auto frames = LiftTake(lifter, LiftInputs(views, 1, Up(camera)), 1.2, 600);
  EXPECT_EQ(frames.at(3).status, Status::kTooFewViews);
  EXPECT_EQ(frames.at(5).status, Status::kNonFiniteInput);
  const dataset::Pose3d pose = ToPose3d(frames, camera.cam_from_world, 0.02);
  EXPECT_EQ(pose.rows.size(), 3u * 19);
  EXPECT_TRUE(LiftTake(lifter, {}, 1.2, 600).empty());
}

TEST(Lifter, SmoothingKeepsEvenMotionAndStillsTrembling) {
  std::map<int, LiftedFrame> frames;
  for (int f = 0; f < 40; ++f) frames[f].x_in_cam.setConstant(0.1 * f + (f % 2 ? 0.02 : -0.02));
  frames[17].status = Status::kTooFewViews, frames[17].x_in_cam.setConstant(1e6);
  auto smooth = frames;
  SmoothTake(0, &smooth);
  EXPECT_EQ(smooth.at(5).x_in_cam, frames.at(5).x_in_cam);
  SmoothTake(2, &smooth);
  EXPECT_NEAR(smooth.at(30).x_in_cam(1, 7), 3.0, 1e-3);  // a Gaussian of 2 frames leaves e^-20 of the trembling; its ends more
  EXPECT_LT(std::abs(smooth.at(16).x_in_cam(0, 0) - 1.6), 0.1);
  EXPECT_EQ(smooth.at(17).x_in_cam(0, 0), 1e6);
}

TEST(Lifter, FilesAreReadBackAndDamageIsRefused) {
  TempDir folder;
  const std::string path = folder / "lifter.safetensors";
  Lifter lifter = MakeLifter(Tiny(0), 1);
  lifter.size_m = 1.3, lifter.sigma_m = 0.02;
  SaveLifter(lifter, path);
  const Lifter read = LoadLifter(path);
  EXPECT_EQ(read.size_m, 1.3);
  EXPECT_EQ(read.sigma_m, 0.02);
  const at::Tensor inputs = at::ones({2, kLiftInputs});
  EXPECT_TRUE(at::equal(Lift(read, inputs), Lift(lifter, inputs)));
  lifter.weights.erase("layer1.bias");
  SaveLifter(lifter, path);
  EXPECT_THROW(LoadLifter(path), FormatError);
  lifter = MakeLifter(Tiny(0), 1);
  SaveLifter(lifter, path);  // size 0
  EXPECT_THROW(LoadLifter(path), FormatError);
  lifter.size_m = 1, lifter.weights["layer0.bias"][3] = std::nan("");
  SaveLifter(lifter, path);
  EXPECT_THROW(LoadLifter(path), FormatError);
  EXPECT_THROW(LoadLifter(folder / "missing"), IoError);
}

TEST(Lifter, ALossThatIsNotFiniteEndsTheTraining) {
  Lifter lifter = MakeLifter(Tiny(10), 1);
  const Lifter fresh = MakeLifter(Tiny(10), 1);
  const LiftSampler broken = [](uint64_t, float* input, float*, float* weight) { input[0] = std::nanf(""), weight[0] = 1; };
  const LiftReport report = TrainLifter(broken, OneThread(), &lifter);
  EXPECT_EQ(report.status, Status::kNonFiniteInput);
  EXPECT_EQ(report.steps_done, 0);
  for (const auto& [name, weight] : fresh.weights) EXPECT_TRUE(at::equal(weight, lifter.weights.at(name)));
}

}  // namespace
}  // namespace mvstudio::testing
