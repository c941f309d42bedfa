#include "calib/rig/frame_offset.h"

#include <algorithm>
#include <cmath>

#include "calib/calibrate.h"
#include "calib/corners/corner_files.h"
#include "calib/formats/formats.h"
#include "calib/lens/resection.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::calib {
namespace {

using Kind = FrameOffsets::Kind;

FrameOffsets Find(const std::vector<Board>& boards, const std::vector<geometry::Camera>& cameras,
                  const std::vector<Detection>& detections) {
  std::vector<int64_t> frames;
  const std::vector<View> views = MakeViews(boards, detections, &frames);
  std::vector<geometry::Rigid3> poses;
  for (const View& view : views)
    poses.push_back(ResectPlane(cameras[static_cast<size_t>(view.camera_idx)], view).cam_from_board);
  return FindFrameOffsets(views, poses, frames, geometry::CameraNames(cameras));
}

/// A board that moves smoothly in front of three cameras; frame numbers are consecutive.
testing::Scene MovingScene(double noise_px, double step) {
  testing::SceneOptions options;
  options.num_cameras = 3;
  options.num_frames = 60;
  testing::Scene scene = testing::MakeScene(options);
  scene.detections.clear();
  Rng noise(7);
  const geometry::Rigid3 world_from_cam0 = geometry::Inverse(scene.truth.cam_from_world[0]);
  for (int f = 0; f < options.num_frames; ++f) {
    const double t = step * f;
    geometry::Rigid3 pose;
    pose.rotation = geometry::RotationExp(0.4 * Eigen::Vector3d(std::sin(1.3 * t), std::cos(0.9 * t), std::sin(0.4 * t)));
    pose.translation = Eigen::Vector3d(0.2 * std::sin(t), 0.15 * std::cos(1.7 * t), 1.1 + 0.2 * std::sin(0.7 * t)) -
                       pose.rotation * Eigen::Vector3d(0.24, 0.15, 0);
    scene.truth.frames[f] = f;
    scene.truth.world_from_board[f] = world_from_cam0 * pose;
    for (int c = 0; c < 3; ++c) {
      Detection detection = testing::Observe(scene, c, f, noise_px, &noise);
      if (detection.num_corners() > 0) scene.detections.push_back(detection);
    }
  }
  return scene;
}

void ShiftCamera(int camera, int64_t by, std::vector<Detection>* detections) {
  for (Detection& d : *detections) d.frame_idx += d.camera_idx == camera ? by : 0;
}

TEST(FrameOffset, SynchronisedIsConsistent) {
  const testing::Scene scene = MovingScene(0.3, 0.2);
  const FrameOffsets offsets = Find({scene.board}, scene.truth.cameras, scene.detections);
  EXPECT_EQ(offsets.kind, Kind::kConsistent);
  EXPECT_EQ(offsets.shift, (std::vector<int64_t>{0, 0, 0}));
  EXPECT_EQ(offsets.text, "");
}

/// Camera 1 lost the frames in `dropped`; what follows moves up.
std::vector<Detection> WithDropped(const testing::Scene& scene, const std::vector<int64_t>& dropped) {
  std::vector<Detection> detections;
  for (Detection d : scene.detections) {
    if (d.camera_idx == 1) {
      if (std::count(dropped.begin(), dropped.end(), d.frame_idx) > 0) continue;
      d.frame_idx -= std::count_if(dropped.begin(), dropped.end(), [&](int64_t f) { return f < d.frame_idx; });
    }
    detections.push_back(d);
  }
  return detections;
}

TEST(FrameSteps, DroppedFramesAreFoundWhereTheyAre) {
  const testing::Scene scene = MovingScene(0.3, 0.2);
  const FrameOffsets offsets = Find({scene.board}, scene.truth.cameras, WithDropped(scene, {15, 35, 36}));
  ASSERT_EQ(offsets.kind, Kind::kInconsistent);
  EXPECT_NE(offsets.text.find("cam0 and cam1 (from frame"), std::string::npos) << offsets.text;
  for (const FramePair& pair : offsets.pairs) {
    if (pair.a != 0 || pair.b != 1) continue;
    ASSERT_EQ(pair.steps.size(), 3u) << offsets.text;
    EXPECT_EQ(pair.steps[1].shift - pair.steps[0].shift, 1);
    EXPECT_EQ(pair.steps[2].shift - pair.steps[0].shift, 3);
    EXPECT_NEAR(static_cast<double>(pair.steps[1].frame), 15, 2);
    EXPECT_NEAR(static_cast<double>(pair.steps[2].frame), 34, 2);
  }
}

/// A clock that runs 3 % fast is two frames ahead in the end.
TEST(FrameSteps, AClockThatDriftsIsNotConsistent) {
  testing::Scene scene = MovingScene(0.3, 0.2);
  std::vector<Detection> detections;
  for (Detection d : scene.detections) {
    const auto ahead = static_cast<int64_t>(std::lround(0.03 * static_cast<double>(d.frame_idx)));
    if (d.camera_idx == 2) d.frame_idx -= ahead;
    const auto twice = [&](const Detection& other) {
      return other.camera_idx == d.camera_idx && other.frame_idx == d.frame_idx;
    };
    if (std::none_of(detections.begin(), detections.end(), twice)) detections.push_back(d);
  }
  const FrameOffsets offsets = Find({scene.board}, scene.truth.cameras, detections);
  EXPECT_EQ(offsets.kind, Kind::kInconsistent);
  EXPECT_NE(offsets.text.find("cam2"), std::string::npos) << offsets.text;
}

TEST(FrameSteps, NoneWhereFramesBelongTogether) {
  for (const double step : {0.02, 0.1, 0.3, 0.6}) {
    for (const double noise_px : {0.0, 0.3, 2.0}) {
      const testing::Scene scene = MovingScene(noise_px, step);
      for (const FramePair& pair : Find({scene.board}, scene.truth.cameras, scene.detections).pairs)
        EXPECT_TRUE(pair.steps.empty()) << step << " " << noise_px;
    }
  }
}

TEST(FrameOffset, ShiftsAreFound) {
  testing::Scene scene = MovingScene(0.3, 0.2);
  for (const int64_t by : {1, -3, 25}) {
    std::vector<Detection> detections = scene.detections;
    ShiftCamera(1, by, &detections);
    FrameOffsets offsets = Find({scene.board}, scene.truth.cameras, detections);
    ASSERT_EQ(offsets.kind, Kind::kShifted) << by << ": " << offsets.text;
    EXPECT_EQ(offsets.shift, (std::vector<int64_t>{0, -by, 0})) << by;
    EXPECT_NE(offsets.text.find("cam1 by " + std::to_string(-by)), std::string::npos) << offsets.text;
    ApplyFrameOffsets(offsets, &detections);
    EXPECT_EQ(Find({scene.board}, scene.truth.cameras, detections).kind, Kind::kConsistent);
  }
}

TEST(FrameOffset, EachCameraItsOwn) {
  testing::Scene scene = MovingScene(0.3, 0.2);
  ShiftCamera(1, 4, &scene.detections);
  ShiftCamera(2, -7, &scene.detections);
  const FrameOffsets offsets = Find({scene.board}, scene.truth.cameras, scene.detections);
  ASSERT_EQ(offsets.kind, Kind::kShifted);
  EXPECT_EQ(offsets.shift[1] - offsets.shift[0], -4);
  EXPECT_EQ(offsets.shift[2] - offsets.shift[0], 7);
}

/// Camera 2's frames from `first` on in any order.
testing::Scene ScrambledScene(int first = 0) {
  testing::Scene scene = MovingScene(0.3, 0.2);
  Rng rng(5);
  std::vector<int64_t> order(60);
  for (int i = 0; i < 60; ++i) order[i] = i;
  for (int i = 59; i > first; --i) std::swap(order[i], order[first + rng.Index(i + 1 - first)]);
  for (Detection& d : scene.detections) d.frame_idx = d.camera_idx == 2 ? order[d.frame_idx] : d.frame_idx;
  return scene;
}

TEST(FrameOffset, ScrambledFramesAreInconsistent) {
  const testing::Scene scene = ScrambledScene();
  const FrameOffsets offsets = Find({scene.board}, scene.truth.cameras, scene.detections);
  EXPECT_EQ(offsets.kind, Kind::kInconsistent);
  EXPECT_NE(offsets.text.find("cam2"), std::string::npos) << offsets.text;
}

TEST(FrameOffset, ADoubtThatTheRigBearsOutStands) {
  CalibrateOptions options;
  options.model = geometry::LensModel::kPinhole;
  for (const int first : {0, 30, 45}) {
    const CalibrateReport report = Calibrate(testing::ToInput(ScrambledScene(first)), options, RunContext());
    EXPECT_NE(report.frames_conflict.find("cam2"), std::string::npos) << first << ": " << report.message;
  }
}

TEST(FrameOffset, ADoubtThatTheRigDispelsIsDropped) {
  FrameOffsets offsets;
  offsets.kind = Kind::kInconsistent;
  FramePair pair;
  pair.kind = FramePair::Kind::kInconsistent, pair.a = 0, pair.b = 1;
  offsets.pairs = {pair};
  const auto views_with = [](int num_lost) {
    std::vector<View> views;
    for (int f = 0; f < 20; ++f) {
      for (int c = 0; c < 2; ++c) {
        View view;
        view.camera_idx = c, view.frame = f;
        view.weights = Eigen::VectorXd::Constant(10, 1.0);
        if (c == 1 && f < num_lost) view.weights.head(6).setZero();
        views.push_back(view);
      }
    }
    return views;
  };
  const std::vector<Eigen::VectorXd> prior(40, Eigen::VectorXd::Constant(10, 1.0));
  FrameOffsets kept = offsets, unexplained = offsets, near = offsets;
  const std::vector<Eigen::Matrix2Xd> far(40, Eigen::Matrix2Xd::Constant(2, 10, 1.0)),
      small = {40, Eigen::Matrix2Xd::Constant(2, 10, 0.02)};
  Reconsider(views_with(0), prior, far, {"left", "right"}, {true, false}, &unexplained);
  EXPECT_EQ(unexplained.kind, Kind::kInconsistent);
  Reconsider(views_with(2), prior, far, {"left", "right"}, {true, true}, &kept);
  EXPECT_EQ(kept.kind, Kind::kInconsistent);
  EXPECT_NE(kept.text.find("left and right"), std::string::npos) << kept.text;
  Reconsider(views_with(1), prior, far, {"left", "right"}, {true, true}, &offsets);
  EXPECT_EQ(offsets.kind, Kind::kConsistent);
  EXPECT_EQ(offsets.text, "");
  // Rejected by a hundredth of a pixel, since the others are nearer still: that is no matter of time.
  Reconsider(views_with(20), prior, small, {"left", "right"}, {true, true}, &near);
  EXPECT_EQ(near.kind, Kind::kConsistent);
}

/// Cameras of few views and hardly any noise, whose corners have heavy tails, as rendered ones do.
TEST(FrameOffset, NearlyPerfectCornersRaiseNoDoubt) {
  testing::SceneOptions options;
  options.num_cameras = 4, options.num_frames = 24, options.model = geometry::LensModel::kBrown2;
  int conflicts_by_pairs = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    options.seed = seed;
    testing::Scene scene = testing::MakeScene(options);
    Rng rng(seed + 50);
    for (Detection& d : scene.detections) {
      const double view_px = rng.Uniform() < 0.25 ? 0.06 : 0.004;  // some views are far worse than the others
      for (Eigen::Index i = 0; i < d.points_px.cols(); ++i)
        d.points_px.col(i) += view_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
    }
    const CalibrateReport report = Calibrate(testing::ToInput(scene), testing::PlainOptions(), RunContext());
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_EQ(report.frames_conflict, "") << seed;
    conflicts_by_pairs += report.rejected_fraction > 0.05;
  }
  EXPECT_GT(conflicts_by_pairs, 0) << "the recordings do not show what they are made for";
}

TEST(FrameOffset, StillBoardAndFewFramesAreUndecided) {
  EXPECT_EQ(Find({MovingScene(0, 0).board}, MovingScene(0, 0).truth.cameras, MovingScene(0.3, 0).detections).kind,
            Kind::kUndecided);
  testing::Scene scene = MovingScene(0.3, 0.2);
  scene.detections.resize(12);
  EXPECT_EQ(Find({scene.board}, scene.truth.cameras, scene.detections).kind, Kind::kUndecided);
}

struct Caliscope {
  CornerFile file;
  std::vector<geometry::Camera> cameras;
};

Caliscope ReadSession() {
  const std::string session = DataRoot() + "/caliscope/sessions/post_optimization";
  Caliscope out{ReadCornerFile(session + "/calibration/extrinsic/xy.csv"), {}};
  const std::string path = session + "/camera_array.toml";
  for (const auto& camera : ReadCalibration(DetectFormat(path), {path}).rig.cameras) out.cameras.push_back(camera.camera);
  return out;
}

TEST(FrameOffset, RealWebcams) {
  MVS_NEEDS_DATA("caliscope");
  const Caliscope session = ReadSession();
  EXPECT_EQ(Find(session.file.boards, session.cameras, session.file.detections).kind, Kind::kConsistent);
  for (int camera = 0; camera < 4; ++camera) {
    for (const int64_t by : {-2, 3, 10}) {
      std::vector<Detection> detections = session.file.detections;
      ShiftCamera(camera, by, &detections);
      const FrameOffsets offsets = Find(session.file.boards, session.cameras, detections);
      EXPECT_EQ(offsets.kind, Kind::kShifted) << camera << " by " << by << ": " << offsets.text;
      // These webcams are synchronised by software: images of one time step lie up to half a frame apart, so that the nearest
      // frame of a camera may be either neighbour.
      ASSERT_EQ(offsets.shift.size(), 4u);
      for (int c = 0; c < 4; ++c) EXPECT_NEAR(offsets.shift[c], c == camera ? -by : 0, 1) << camera << " by " << by;
    }
  }
}

TEST(FrameOffset, RealWebcamsByFileOrder) {
  MVS_NEEDS_DATA("caliscope");
  Caliscope session = ReadSession();
  std::vector<int64_t> next(4, 0);
  for (Detection& d : session.file.detections) d.frame_idx = next[d.camera_idx]++;
  const FrameOffsets offsets = Find(session.file.boards, session.cameras, session.file.detections);
  EXPECT_EQ(offsets.kind, Kind::kInconsistent) << offsets.text;
}

}  // namespace
}  // namespace mvstudio::calib
