#include "calib/check/seen_corners.h"

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/check/rig_check.h"
#include "calib/check/same_corners.h"
#include "tests/calib/filmed.h"
#include "tests/support/test.h"

/// What is found about corners counts for every later step: a calibration agrees with its own corners.
namespace mvstudio::calib {
namespace {

/// One corner of camera 1 in some frames, at x = x(frame).
CalibrateInput Moving(const std::vector<int64_t>& frames, const std::function<double(double)>& x) {
  CalibrateInput input;
  input.boards = {ParseBoard("chessboard:9x6:60mm")};
  input.cameras = {{"a", 640, 480}, {"b", 640, 480}};
  for (const int64_t f : frames) {
    Detection d;
    d.camera_idx = 1, d.frame_idx = f, d.corner_ids = {7};
    d.points_px = Eigen::Vector2d(x(static_cast<double>(f)), 5);
    input.detections.push_back(d);
  }
  return input;
}

TEST(AtFrameTimes, FollowsTheParabolaThroughNeighboursUpToTwoFramesAway) {
  const auto x = [](double f) { return 100 + 7 * f - 0.3 * f * f; };
  const std::vector<int64_t> frames = {0, 1, 2, 4, 5};
  for (const double late : {0.4, -0.3}) {
    const CalibrateInput seen = AtFrameTimes(Moving(frames, x), {{0}, {late}});
    for (size_t i = 1; i + 1 < frames.size(); ++i)
      EXPECT_NEAR(seen.detections[i].points_px(0, 0), x(static_cast<double>(frames[i]) - late), 1e-9)
          << late << " " << frames[i];
    EXPECT_NEAR(seen.detections[0].points_px(0, 0), x(0) - late * (x(1) - x(0)), 1e-9) << "the line at the end";
  }
}

/// A clock that runs apart is a frame late and more.
TEST(AtFrameTimes, FollowsTheImagesAroundTheTime) {
  const auto x = [](double f) { return 100 + 7 * f - 0.3 * f * f; };
  for (const double late : {0.8, 1.7, -2.4}) {
    const CalibrateInput seen = AtFrameTimes(Moving({0, 1, 2, 3, 4, 5, 6}, x), {{0}, {late}});
    EXPECT_NEAR(seen.detections[3].points_px(0, 0), x(3 - late), 1e-9) << late;
  }
  const CalibrateInput beyond = AtFrameTimes(Moving({0, 1, 2}, x), {{0}, {5}});
  EXPECT_EQ(beyond.detections[1].points_px(0, 0), x(1)) << "no image near the time";
}

TEST(AtFrameTimes, FollowsSparseFramesAndClocksThatDrift) {
  const auto x = [](double f) { return 100 + 3 * f - 0.02 * f * f + 1e-4 * f * f * f; };
  const std::vector<int64_t> frames = {0, 8, 16, 24, 32, 40};
  const CalibrateInput seen = AtFrameTimes(Moving(frames, x), {{0}, {0.5, 0, 0.01, 0}});
  for (size_t i = 2; i + 2 < frames.size(); ++i) {
    const double f = static_cast<double>(frames[i]);
    EXPECT_NEAR(seen.detections[i].points_px(0, 0), x(f - 0.5 - 0.01 * f), 1e-9) << f;
  }
}

TEST(AtFrameTimes, LeavesWhatNoNeighbourMovesAndCamerasInTime) {
  const auto x = [](double f) { return 9 * f; };
  const CalibrateInput alone = AtFrameTimes(Moving({3}, x), {{0}, {0.5}});
  for (const Detection& d : alone.detections) EXPECT_EQ(d.points_px(0, 0), x(static_cast<double>(d.frame_idx)));
  const CalibrateInput in_time = AtFrameTimes(Moving({0, 1, 2}, x), {{0.5}, {0}});
  for (const Detection& d : in_time.detections) EXPECT_EQ(d.points_px(0, 0), x(static_cast<double>(d.frame_idx)));
}

std::string Words(const RigCheck& check) {
  std::string text = check.message;
  for (const auto& reason : check.verdict.reasons) text += "; " + reason.text;
  return text;
}

void ExpectNothingMoved(const RigCheck& check, const std::string& what) {
  EXPECT_EQ(check.status, Status::kOk) << what << ": " << check.message;
  EXPECT_TRUE(check.moved.empty() && check.undecided.empty()) << what << ": " << Words(check);
  EXPECT_NE(check.verdict.outcome(), Outcome::kFail) << what << ": " << Words(check);
}

void Turn(Detection* d) {
  for (int& id : d->corner_ids) id = 53 - id;
}

struct Case {
  std::string what;
  std::vector<double> late;
  std::function<void(Detection*)> change;
};

std::vector<Case> Cases() {
  return {
      {"one camera upside down", {0, 0}, [](Detection* d) { d->camera_idx == 1 ? Turn(d) : void(); }},
      {"any view turned", {0, 0, 0}, [](Detection* d) { (d->camera_idx * 7 + d->frame_idx * 5) % 11 < 5 ? Turn(d) : void(); }},
      {"frames and a part", {0, 0, 0.3}, [](Detection* d) { d->frame_idx -= d->camera_idx == 2 ? 5 : 0; }},
      {"any view turned, one camera shifted",
       {0, 0, 0.3},
       [](Detection* d) {
         const bool rotated = (d->camera_idx * 7 + d->frame_idx * 5) % 11 < 5;
         rotated ? Turn(d) : void();
         d->frame_idx -= d->camera_idx == 2 ? 5 : 0;
       }},
      {"turned and late", {0, 0.3, 0}, [](Detection* d) { d->frame_idx % 3 == 0 && d->camera_idx > 0 ? Turn(d) : void(); }}};
}

/// Numbering and timing of the input, whatever they are: no motion in the calibration, and none on its own corners.
TEST(SeenCorners, ACalibrationAgreesWithItsOwnCorners) {
  for (const Case& each : Cases()) {
    CalibrateInput input = testing::ToInput(Film(each.late, 36, 0.2));
    for (Detection& d : input.detections) each.change(&d);
    const CalibrateReport report = Calibrate(input, WithClocks(), {});
    ASSERT_EQ(report.status, Status::kOk) << each.what << ": " << report.message;
    EXPECT_LT(report.rms_px, 0.32) << each.what << ": " << report.time_reason;
    EXPECT_TRUE(report.motions.empty()) << each.what;
    const RigCheck check = CheckRig(report.rig, input, {}, {});
    ExpectNothingMoved(check, each.what);
    EXPECT_LT(check.rms_px, 0.32) << each.what;
  }
}

TEST(SeenCorners, CamerasThatTheCalibrationLacksAreLeftOut) {
  const CalibrateInput input = testing::ToInput(Film({0, 0, 0, 0}, 20, 0.2));
  const CalibrateReport report = Calibrate(InputOf(input, {0, 1, 3}), WithClocks(), {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  const RigCheck check = CheckRig(report.rig, input, {}, {});
  ExpectNothingMoved(check, "one left out");
  EXPECT_EQ(check.found.unknown, std::vector<std::string>{"cam2"});
}

/// From frame 30 on, camera 1 stands elsewhere; `in_time` are the frames that are kept.
CalibrateInput Bumped(int64_t first, int64_t last) {
  testing::Scene before = Film({0, 0, 0}, 48, 0.2), after = before;
  geometry::Rigid3& pose = after.truth.cam_from_world[1];
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0.02, 0)) * pose.rotation;
  for (size_t f = 0; f < 48; ++f) after.truth.world_from_board[f] = before.truth.world_from_board[f];
  testing::ObserveAll(&after, 0.2, 5);
  CalibrateInput input = testing::ToInput(before);
  input.detections.clear();
  for (const testing::Scene* scene : {&before, &after}) {
    for (const Detection& d : scene->detections) {
      const bool moved = d.camera_idx == 1 && d.frame_idx >= 34;
      if (moved == (scene == &after) && d.frame_idx >= first && d.frame_idx < last) input.detections.push_back(d);
    }
  }
  return input;
}

/// A camera in two parts: its own recording by frames, a later one by the last part.
TEST(SeenCorners, PartsOfASplitCameraAreToldApart) {
  CalibrateOptions options = WithClocks();
  options.split_at = {{"cam1", 34, false}};
  const CalibrateInput input = Bumped(0, 100);
  const CalibrateReport report = Calibrate(input, options, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  ExpectNothingMoved(CheckRig(report.rig, input, {}, {}), "its own corners");
  CalibrateInput later = Bumped(34, 100);
  for (Detection& d : later.detections) d.frame_idx -= 34;
  ExpectNothingMoved(CheckRig(report.rig, later, {}, {}), "a later recording, numbered anew");
}

TEST(SameCorners, OneFileForTwoCamerasIsNamed) {
  CalibrateInput input = testing::ToInput(Film({0, 0, 0}, 8, 0.2));
  EXPECT_FALSE(FindSameCorners(input));
  for (Detection& d : input.detections) {
    if (d.camera_idx != 2) continue;
    const auto same = std::find_if(input.detections.begin(), input.detections.end(),
                                   [&](const Detection& o) { return o.camera_idx == 0 && o.frame_idx == d.frame_idx; });
    if (same != input.detections.end()) d.points_px = same->points_px, d.corner_ids = same->corner_ids;
    d.frame_idx += 3;  // under other numbers, too
  }
  const auto found = FindSameCorners(input);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->a + " " + found->b, "cam0 cam2");
  EXPECT_NE(ToString(*found).find("give each its own"), std::string::npos);
}

/// One board says nothing about numbering by itself; with the poses of the rig it does.
TEST(SeenCorners, OneRotatedViewIsKnownByTheRig) {
  const testing::Scene scene = Film({0, 0}, 8, 0.2);
  CalibrateInput input = testing::ToInput(scene);
  input.detections.erase(
      std::remove_if(input.detections.begin(), input.detections.end(), [](const Detection& d) { return d.frame_idx > 11; }),
      input.detections.end());
  for (Detection& d : input.detections) d.camera_idx == 1 ? Turn(&d) : void();
  const RigCheck check = CheckRig(testing::TruthRig(scene), input, {}, {});
  ExpectNothingMoved(check, "two boards");
  ASSERT_EQ(check.found.rotated.size(), 1u);
}

/// Clocks that were started anew: the offsets of the calibration belong to another recording.
TEST(SeenCorners, OffsetsThatTheCornersContradictAreNotApplied) {
  const testing::Scene scene = Film({0, 0, 0}, 40, 0.2);
  geometry::Rig rig = testing::TruthRig(scene);
  rig.cameras[1].time_offset = geometry::TimeOffset{-0.4, 0.01};
  const RigCheck check = CheckRig(rig, testing::ToInput(scene), {}, {});
  ExpectNothingMoved(check, "no camera is late");
  EXPECT_TRUE(check.offsets_stated && !check.offsets_used);
  const testing::Scene late = Film({0, 0.4, 0}, 40, 0.2);
  const RigCheck used = CheckRig(rig, testing::ToInput(late), {}, {});
  ExpectNothingMoved(used, "as stated");
  EXPECT_TRUE(used.offsets_used);
}

/// A format without time offsets, or cameras that were started anew: late, and not moved.
TEST(SeenCorners, TimeOffsetThatTheCalibrationDoesNotStateIsNoMotion) {
  const std::vector<std::vector<double>> cases = {{0, 0.35}, {0, 0.3, 0}, {0, 0.3, -0.2, 0}};
  for (const std::vector<double>& late : cases) {
    const testing::Scene scene = Film(late, 40, 0.2);
    const RigCheck check = CheckRig(testing::TruthRig(scene), testing::ToInput(scene), {}, {});
    const std::string what = std::to_string(late.size()) + " cameras";
    ExpectNothingMoved(check, what);
    ASSERT_FALSE(check.late.empty()) << what << ": " << Words(check);
    for (const LateCamera& camera : check.late) {
      const double truth = late[static_cast<size_t>(camera.camera.back() - '0')];
      EXPECT_NEAR(camera.frames, truth, 0.03) << what << " " << camera.camera;
      EXPECT_NE(truth, 0) << what << " " << camera.camera;
    }
    EXPECT_NE(Words(check).find("which the calibration does not state"), std::string::npos) << Words(check);
  }
}

/// A camera that did move is found beside what is put right.
TEST(SeenCorners, AMotionIsFoundBesideRotatedAndLateViews) {
  const testing::Scene scene = Film({0, 0.3, 0, 0}, 40, 0.2);
  geometry::Rig rig = testing::TruthRig(scene);
  rig.cameras[1].time_offset = geometry::TimeOffset{-0.3, 0.01};
  geometry::Rigid3& pose = rig.cameras[2].cam_from_world;
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0.006, 0)) * pose.rotation;
  CalibrateInput input = testing::ToInput(scene);
  for (Detection& d : input.detections) d.camera_idx == 3 && d.frame_idx % 2 == 0 ? Turn(&d) : void();
  const RigCheck check = CheckRig(rig, input, {}, {});
  EXPECT_EQ(check.moved, std::vector<std::string>{"cam2"}) << Words(check);
  EXPECT_LT(CheckRig(check.repaired, input, {}, {}).cost, 0.5 * CheckRig(rig, input, {}, {}).cost + 1.2);
}

}  // namespace
}  // namespace mvstudio::calib
