#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/rig/plausible.h"
#include "tests/triangulate/people.h"
#include "tests/triangulate/support.h"
#include "triangulate/sync/sync.h"
#include "triangulate/take/cause.h"

namespace mvstudio::triangulate {
namespace {

using ::testing::HasSubstr;

constexpr int kFrames = 160;

/// HD cameras around people, each with a lens of its own.
geometry::Rig MakeStudio(int num_cameras = 5) {
  geometry::Rig rig;
  for (int i = 0; i < num_cameras; ++i) {
    const double angle = 2 * kPi * (i + 0.3) / num_cameras;
    rig.cameras.push_back(LookAt("cam_" + std::to_string(i), {4.5 * std::cos(angle), 4.5 * std::sin(angle), i % 2 ? 2.4 : 1.3},
                                 {0, 0, 0.9}, 1150 + 30 * i, 1920, 1088));
    geometry::Camera& lens = rig.cameras.back().camera;
    const Eigen::Vector4d pinhole = lens.params.head<4>();
    lens.model = geometry::LensModel::kBrown5;
    lens.params.resize(9);
    lens.params << pinhole, -0.25 + 0.01 * i, 0.12, 1e-3, -5e-4, -0.05;
  }
  return rig;
}

/// People who walk and wave, without a period that a shift in time could fall into.
std::vector<Walker> WalkersAt(int frame, int count) {
  std::vector<Walker> walkers(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) {
    Walker& w = walkers[static_cast<size_t>(i)];
    const double t = frame / 30.0, phase = 2.1 * i;
    w.position = {0.9 * std::sin(0.7 * t + phase) + 0.2 * std::sin(1.9 * t), 0.9 * std::cos(0.5 * t + phase)};
    w.heading = phase + 0.6 * t + 0.5 * std::sin(1.3 * t);
    w.phase = 5 * t + phase;
    w.arm_left = 0.4 + 0.8 * std::sin(2.3 * t + phase), w.arm_right = 0.3 + 0.9 * std::sin(1.7 * t);
  }
  return walkers;
}

std::vector<DetectedFrame> Film(const geometry::Rig& rig, int num_people = 1) {
  DetectorOptions options;
  options.noise_px = 3;
  Rng rng(17);
  std::vector<DetectedFrame> frames;
  for (int f = 0; f < kFrames; ++f) frames.push_back(Detect(rig, WalkersAt(f, num_people), f, options, &rng).frame);
  return frames;
}

TakeBody Body() { return {25, {WalkerMirror()}}; }

CauseReport Search(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, int max_persons = 1) {
  CauseOptions options;
  options.max_persons = max_persons;
  return RankCauses(rig, frames, Body(), options);
}

void ExpectFound(const CauseReport& report, Cause cause, const std::string& words) {
  ASSERT_FALSE(report.trials.empty());
  EXPECT_EQ(report.trials[0].cause, cause) << ToString(report.trials[0].cause) << ": " << report.trials[0].assumption;
  EXPECT_TRUE(report.trials[0].clear) << report.trials[0].carried << " " << report.as_given.carried;
  EXPECT_THAT(report.message, HasSubstr(words));
  EXPECT_GT(report.trials[0].carried, 0.8);
  EXPECT_LT(report.trials[0].residual_px, report.as_given.residual_px);
}

TEST(Cause, AGoodTakeNamesNone) {
  const geometry::Rig rig = MakeStudio();
  for (const int people : {1, 2}) {
    const CauseReport report = Search(rig, Film(rig, people), people);
    EXPECT_EQ(report.message, "");
    EXPECT_GT(report.as_given.carried, 0.8);
    for (const CauseTrial& trial : report.trials) EXPECT_FALSE(trial.clear) << trial.assumption;
  }
}

TEST(Cause, NorDoesOneThatNoAssumptionExplains) {
  const geometry::Rig rig = MakeStudio();
  std::vector<DetectedFrame> frames = Film(rig);
  Rng rng(3);
  for (DetectedFrame& frame : frames) {
    for (auto& people : frame.people) {
      for (DetectedPerson& person : people) {
        for (Keypoint& key : person) key.px = {rng.Uniform(0, 1919), rng.Uniform(0, 1087)};
      }
    }
  }
  const CauseReport report = Search(rig, frames);
  EXPECT_EQ(report.message, "");
  EXPECT_LT(report.as_given.carried, 0.1);
}

/// As in a file found in the wild: the images are undistorted, the file still lists terms, one of them absurd.
TEST(Cause, DistortionThatTheImagesDoNotHave) {
  geometry::Rig pinholes = MakeStudio();
  for (geometry::RigCamera& camera : pinholes.cameras) camera.camera = PinholeOf(camera.camera);
  const std::vector<DetectedFrame> frames = Film(pinholes, 2);
  geometry::Rig listed = pinholes;
  for (geometry::RigCamera& camera : listed.cameras) {
    const Eigen::Vector4d pinhole = camera.camera.params;
    camera.camera.model = geometry::LensModel::kBrown5;
    camera.camera.params.resize(9);
    camera.camera.params << pinhole, -0.05, 0.02, 6.459, 0.4, 0.1;
  }
  const CauseReport report = Search(listed, frames, 2);
  ExpectFound(report, Cause::kDistortion, "without distortion");
  EXPECT_LT(report.as_given.carried, 0.3);
}

TEST(Cause, TermsInAnotherOrder) {
  geometry::Rig rig = MakeStudio();
  for (geometry::RigCamera& camera : rig.cameras) camera.camera.params.tail<5>() << -0.45, 0.25, 1e-3, -5e-4, 0.3;
  geometry::Rig read = rig;
  for (geometry::RigCamera& camera : read.cameras) {
    Eigen::VectorXd& p = camera.camera.params;
    const double k3 = p[8], p1 = p[6], p2 = p[7];
    p[6] = k3, p[7] = p1, p[8] = p2;  // the file says k1 k2 k3 p1 p2
  }
  ExpectFound(Search(read, Film(rig)), Cause::kTermOrder, "k1 k2 k3 p1 p2");
}

TEST(Cause, ImagesOfHalfTheSize) {
  const geometry::Rig rig = MakeStudio();
  std::vector<DetectedFrame> frames = Film(rig);
  for (DetectedFrame& frame : frames) {
    for (auto& people : frame.people) {
      for (DetectedPerson& person : people) {
        for (Keypoint& key : person) key.px *= 0.5;
      }
    }
  }
  ExpectFound(Search(rig, frames), Cause::kImageSize, "the images half the calibrated size");
}

TEST(Cause, ImagesCroppedFrom1088To1080) {
  const geometry::Rig rig = MakeStudio();
  DetectorOptions sharp;
  sharp.noise_px = 0.5, sharp.outlier_joints = 0, sharp.false_people = 0;
  Rng rng(5);
  std::vector<DetectedFrame> frames;
  for (int f = 0; f < kFrames; ++f) frames.push_back(Detect(rig, WalkersAt(f, 1), f, sharp, &rng).frame);
  for (DetectedFrame& frame : frames) {
    for (DetectedPerson& person : frame.people[3]) {
      for (Keypoint& key : person) key.px.y() -= 8;
    }
  }
  ExpectFound(Search(rig, frames), Cause::kImageSize, "the images of cam_3 cropped to 1080 px high at the top");
}

TEST(Cause, ACameraThatIsSecondsLate) {
  const geometry::Rig rig = MakeStudio(4);
  std::vector<DetectedFrame> frames = Film(rig);
  constexpr int kLate = 61;
  for (int f = kFrames - 1; f >= 0; --f) {
    auto& people = frames[static_cast<size_t>(f)].people;
    for (const size_t camera : {1u, 3u}) {
      people[camera] = f >= kLate ? frames[static_cast<size_t>(f - kLate)].people[camera] : std::vector<DetectedPerson>();
    }
  }
  const CauseReport report = Search(rig, frames);
  ExpectFound(report, Cause::kTimeOffset, "with cam_");
  EXPECT_THAT(report.message, ::testing::AnyOf(HasSubstr("61.0 frames"), HasSubstr("60.9 frames"), HasSubstr("61.1 frames")));
}

/// Late by little or much, by a whole number or not: each is found by the check of the timing alone; a good take has none.
TEST(Cause, TimingIsCheckedByItself) {
  const geometry::Rig rig = MakeStudio(4);
  const std::vector<DetectedFrame> good = Film(rig);
  EXPECT_EQ(CheckTiming(rig, good, {}).message, "");
  EXPECT_TRUE(CheckTiming(rig, good, {}).trials.empty());
  for (const double late : {5.0, 10.5, 40.0}) {
    const CauseReport report = CheckTiming(rig, ApplyOffsets(good, {0, 0, late, 0}), {});
    ExpectFound(report, Cause::kTimeOffset, "with cam_2");
    EXPECT_NEAR(report.trials[0].offset_frames, late, 0.2);
  }
  const CauseReport little = CheckTiming(rig, ApplyOffsets(good, {0, 0, 2, 0}), {});  // sure, but within the noise
  EXPECT_EQ(little.message, "");
  ASSERT_EQ(little.trials.size(), 1u);
  EXPECT_NEAR(little.trials[0].offset_frames, 2, 0.2);
  EXPECT_LT(little.trials[0].residual_px, little.as_given.residual_px);
  EXPECT_TRUE(CheckTiming(rig, {}, {}).trials.empty());
}

TEST(Cause, TwoCamerasExchanged) {
  const geometry::Rig rig = MakeStudio(4);
  std::vector<DetectedFrame> frames = Film(rig);
  for (DetectedFrame& frame : frames) std::swap(frame.people[0], frame.people[2]);
  ExpectFound(Search(rig, frames), Cause::kExchanged, "the detections of cam_0 and cam_2 exchanged");
}

/// The detector takes the mirrored left hand for a right one.
TEST(Cause, AMirroredCamera) {
  const geometry::Rig rig = MakeStudio(4);
  std::vector<DetectedFrame> frames = Film(rig);
  for (DetectedFrame& frame : frames) {
    for (DetectedPerson& person : frame.people[1]) {
      for (Keypoint& key : person) key.px.x() = 1919 - key.px.x();
      for (const auto& [left, right] : WalkerMirror())
        std::swap(person[static_cast<size_t>(left)], person[static_cast<size_t>(right)]);
    }
  }
  ExpectFound(Search(rig, frames), Cause::kMirrored, "the images of cam_1 mirrored");
}

/// Every pixel of one camera, or of all with -1, changed.
template <class Change>
std::vector<DetectedFrame> Changed(std::vector<DetectedFrame> frames, int only, const Change& change) {
  for (DetectedFrame& frame : frames) {
    for (size_t c = 0; c < frame.people.size(); ++c) {
      if (only >= 0 && static_cast<size_t>(only) != c) continue;
      for (DetectedPerson& person : frame.people[c]) {
        for (Keypoint& key : person) change(&key.px);
      }
    }
  }
  return frames;
}

void ExpectRemedy(const CauseReport& report, Cause cause, const std::string& remedy) {
  ASSERT_FALSE(report.trials.empty());
  EXPECT_EQ(report.trials[0].cause, cause) << ToString(report.trials[0].cause) << ": " << report.trials[0].assumption;
  EXPECT_TRUE(report.trials[0].clear) << report.trials[0].carried << " " << report.as_given.carried;
  EXPECT_EQ(report.trials[0].remedy, remedy);
}

TEST(Cause, CoordinatesThatAreNoPixelsFromTheTopLeft) {
  const geometry::Rig rig = MakeStudio(4);
  const std::vector<DetectedFrame> good = Film(rig);
  const auto parts = [](Eigen::Vector2d* px) { *px = px->cwiseQuotient(Eigen::Vector2d(1920, 1088)); };
  const auto below = [](Eigen::Vector2d* px) { px->y() = 1088 - px->y(); };
  const auto rotated = [](Eigen::Vector2d* px) { *px = Eigen::Vector2d(1087 - px->y(), px->x()); };
  ExpectRemedy(Search(rig, Changed(good, -1, parts)), Cause::kNormalized, "option 'normalized'");
  const auto centred = [&](Eigen::Vector2d* px) { parts(px), *px = (2 * *px).array() - 1; };
  const auto percent = [&](Eigen::Vector2d* px) { parts(px), *px *= 100; };
  const auto rows_first = [](Eigen::Vector2d* px) { std::swap(px->x(), px->y()); };
  ExpectRemedy(Search(rig, Changed(good, -1, centred)), Cause::kNormalized, "option 'normalized'");
  ExpectRemedy(Search(rig, Changed(good, -1, percent)), Cause::kNormalized, "option 'normalized'");
  ExpectRemedy(Search(rig, Changed(good, -1, rows_first)), Cause::kRotated, "option 'rotate' 90 option 'flip-x'");
  ExpectRemedy(Search(rig, Changed(good, 2, parts)), Cause::kNormalized, "option 'normalized' cam_2");
  ExpectRemedy(Search(rig, Changed(good, -1, below)), Cause::kFlippedY, "option 'flip-y'");
  ExpectRemedy(Search(rig, Changed(good, 1, below)), Cause::kFlippedY, "option 'flip-y' cam_1");
  ExpectRemedy(Search(rig, Changed(good, -1, rotated)), Cause::kRotated, "option 'rotate' 90");
  ExpectRemedy(Search(rig, Changed(good, 3, rotated)), Cause::kRotated, "option 'rotate' cam_3=90");
  ExpectRemedy(Search(rig, Changed(Changed(good, 0, rotated), 2, rotated)), Cause::kRotated,
               "option 'rotate' cam_0=90 option 'rotate' cam_2=90");
  const auto upside_down = [](Eigen::Vector2d* px) { *px = Eigen::Vector2d(1919, 1087) - *px; };
  const CauseReport three = Search(rig, Changed(Changed(Changed(good, 0, upside_down), 1, upside_down), 3, upside_down));
  ExpectRemedy(three, Cause::kRotated, "option 'rotate' cam_0=180 option 'rotate' cam_1=180 option 'rotate' cam_3=180");
  ExpectFound(three, Cause::kRotated, "the images of cam_0, cam_1, cam_3 turned by 180 degrees");
}

TEST(Cause, PosesThatAreInvertedOrMirrored) {
  const geometry::Rig rig = MakeStudio(4);
  const std::vector<DetectedFrame> good = Film(rig);
  geometry::Rig inverted = rig, mirrored = rig;
  for (geometry::RigCamera& camera : inverted.cameras) camera.cam_from_world = Inverse(camera.cam_from_world);
  const Eigen::Vector3d flip(1, -1, 1);
  for (geometry::RigCamera& camera : mirrored.cameras) {
    const Eigen::Matrix3d rotation = flip.asDiagonal() * camera.cam_from_world.rotation.toRotationMatrix() * flip.asDiagonal();
    camera.cam_from_world = {Eigen::Quaterniond(rotation), flip.cwiseProduct(camera.cam_from_world.translation)};
  }
  ExpectRemedy(Search(inverted, good), Cause::kInverted, "option 'invert'");
  TakeBody body = Body();
  body.sides = {0, 5, 2, 12, 9};
  ExpectRemedy(RankCauses(mirrored, good, body, {}), Cause::kMirroredPoses, "option 'mirror'");
}

TEST(Cause, DoesNotDependOnThreads) {
  const geometry::Rig rig = MakeStudio(4);
  std::vector<DetectedFrame> frames = Film(rig, 2);
  for (DetectedFrame& frame : frames) std::swap(frame.people[0], frame.people[2]);
  RunContext one, two;
  one.num_threads = 1, two.num_threads = 2;
  CauseOptions options;
  options.max_frames = 12;
  const CauseReport a = RankCauses(rig, frames, Body(), options, one), b = RankCauses(rig, frames, Body(), options, two);
  EXPECT_EQ(a.message, b.message);
  ASSERT_EQ(a.trials.size(), b.trials.size());
  for (size_t i = 0; i < a.trials.size(); ++i) EXPECT_EQ(a.trials[i].residual_px, b.trials[i].residual_px);
}

TEST(Cause, TakesWithoutAnythingToGoBy) {
  const geometry::Rig rig = MakeStudio(3);
  EXPECT_EQ(RankCauses(rig, {}, Body(), {}).message, "");
  EXPECT_TRUE(RankCauses(rig, {DetectedFrame{0, {{}, {}, {}}}}, Body(), {}).trials.empty());
  std::vector<DetectedFrame> alone = Film(rig);  // one camera sees people
  for (DetectedFrame& frame : alone) frame.people[0].clear(), frame.people[1].clear();
  EXPECT_TRUE(RankCauses(rig, alone, Body(), {}).trials.empty());
}

/// Each joint is seen by two cameras at a time: less is known, but something.
TEST(Cause, TwoViewsAPoint) {
  const geometry::Rig rig = MakeStudio(4);
  std::vector<DetectedFrame> frames = Film(rig);
  for (DetectedFrame& frame : frames)
    frame.people[frame.frame / 9 % 4].clear(), frame.people[(frame.frame / 9 + 1) % 4].clear();
  const CauseTrial trial = FitAsGiven(rig, frames, {});
  EXPECT_GT(trial.num_detections, 500);
  EXPECT_GT(trial.carried, 0.8);
  EXPECT_EQ(FitAsGiven(rig, {}, {}).num_detections, 0);
}

TEST(NumTriangulable, CountsJointsThatEnoughCamerasSee) {
  const Keypoint seen{{1, 1}, 0.9}, weak{{1, 1}, 0.1};
  DetectedFrame frame;
  frame.people = {{{seen, seen}, {seen, seen}}, {{seen, weak}, {seen, weak}, {seen, weak}}, {}};
  EXPECT_EQ(NumTriangulable(frame, 0.3, 9), 2);  // two people's first joint; the posters of one camera do not count
  EXPECT_EQ(NumTriangulable(frame, 0.3, 1), 1);
  EXPECT_EQ(NumTriangulable(frame, 0.05, 9), 4);
  EXPECT_EQ(NumTriangulable(frame, 0.3, 9, 3), 0);
}

}  // namespace
}  // namespace mvstudio::triangulate
