#include "stages/input/first_frames.h"

#include <cmath>

#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// Whose frames are 1 to N beside frames 0 to N - 1: a program that counts from 1, or each missed one end of the take.
namespace mvstudio::stages {
namespace {

constexpr int kFrames = 120, kJoints = 5;

/// Joints that move without a common period; metres.
Eigen::Vector3d JointAt(int joint, int frame) {
  Eigen::Vector3d x;
  for (int axis = 0; axis < 3; ++axis) {
    const double k = 3 * joint + axis;
    x[axis] = 0.3 * std::sin(0.21 * frame + 1.7 * k) + 0.2 * std::sin((0.34 + 0.01 * k) * frame + 0.9 * k);
  }
  return x;
}

geometry::Skeleton Skeleton() { return geometry::PointsSkeleton({"p", "q", "r", "s", "t"}); }

/// What a camera saw at times `first` to `last` (frames from 0), which its file calls `shift` more.
dataset::Pose2dTrack Seen(const geometry::RigCamera& camera, int first, int last, int shift) {
  dataset::Pose2dTrack track{camera.camera.name, {}};
  for (int frame = first; frame <= last; ++frame) {
    dataset::Person2d person;
    for (int j = 0; j < kJoints; ++j) {
      const auto at = geometry::Project(camera.camera, camera.cam_from_world * JointAt(j, frame));
      person.keypoints.push_back({at.px.x(), at.px.y(), 1});
    }
    track.frames[frame + shift] = {person};
  }
  return track;
}

struct Numbered {
  int first = -1;  ///< number of the last camera's first frame
  InputNotes notes;
};

Numbered Number(std::vector<dataset::Pose2dTrack> tracks, const NumberingRig& with) {
  Numbered found;
  NumberFromZero({}, {}, &tracks, &found.notes, with);
  found.first = tracks.back().frames.begin()->first;
  return found;
}

/// Both detectors write nothing for frames without people: camera 2 missed frame 0, the others the last.
TEST(FirstFrames, MissedEndsAreNoOtherCount) {
  const geometry::Rig rig = triangulate::MakeRing(3);
  const geometry::Skeleton skeleton = Skeleton();
  const auto of = [&](int camera, int first, int last, int shift) {
    return Seen(rig.cameras[static_cast<size_t>(camera)], first, last, shift);
  };
  const std::vector<dataset::Pose2dTrack> missed = {of(0, 0, kFrames - 2, 0), of(1, 0, kFrames - 2, 0),
                                                    of(2, 1, kFrames - 1, 0)};
  const Numbered by_motion = Number(missed, {&rig, &skeleton});
  EXPECT_EQ(by_motion.first, 1);
  EXPECT_TRUE(by_motion.notes.warnings.empty());
  const Numbered unknown = Number(missed, {});
  EXPECT_EQ(unknown.first, 1) << "nothing tells";
  ASSERT_EQ(unknown.notes.warnings.size(), 1u);
  EXPECT_EQ(unknown.notes.warnings[0].code, "POSE-FIRST");
  EXPECT_THAT(unknown.notes.warnings[0].text, HasSubstr("missed one end"));

  const std::vector<dataset::Pose2dTrack> counted = {of(0, 0, kFrames - 2, 0), of(1, 0, kFrames - 2, 0),
                                                     of(2, 0, kFrames - 2, 1)};
  const Numbered moved = Number(counted, {&rig, &skeleton});
  EXPECT_EQ(moved.first, 0);
  ASSERT_EQ(moved.notes.warnings.size(), 1u);
  EXPECT_THAT(moved.notes.warnings[0].text, HasSubstr("was taken for frame 0"));
}

/// A program that lists frames without people would have listed the frame that it missed.
TEST(FirstFrames, AProgramThatListsEveryFrameIsEvidence) {
  const geometry::Rig rig = triangulate::MakeRing(2);
  std::vector<dataset::Pose2dTrack> tracks = {Seen(rig.cameras[0], 0, 9, 0), Seen(rig.cameras[1], 0, 9, 1)};
  EXPECT_EQ(Number(tracks, {}).first, 1);
  tracks[1].every_frame = true;
  EXPECT_EQ(Number(tracks, {}).first, 0);
  tracks[1].every_frame = false;
  tracks[0].frames[4].clear();
  EXPECT_EQ(Number(tracks, {}).first, 0) << "it lists a frame in which it found nobody";
}

}  // namespace
}  // namespace mvstudio::stages
