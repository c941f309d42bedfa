#include "triangulate/people/sides.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <set>

#include "geometry/skeleton/skeleton.h"
#include "tests/support/test_data.h"
#include "tests/triangulate/people.h"
#include "tests/triangulate/recordings.h"

namespace mvstudio::triangulate {
namespace {

using Assignment = std::vector<std::vector<std::vector<int>>>;
using Pairs = std::vector<std::pair<int, int>>;

void Mirror(const Pairs& pairs, DetectedPerson* person) {
  for (const auto& [l, r] : pairs) std::swap((*person)[l], (*person)[r]);
}

Pairs Flatten(const MirrorGroups& groups) {
  Pairs all;
  for (const Pairs& pairs : groups) all.insert(all.end(), pairs.begin(), pairs.end());
  return all;
}

/// One person of every camera; detection 0.
Assignment OnePerson(const std::vector<DetectedFrame>& frames) {
  Assignment assignment;
  for (const DetectedFrame& frame : frames) {
    std::vector<int>& choice = assignment.emplace_back(1).front();
    for (const auto& people : frame.people) choice.push_back(people.empty() ? -1 : 0);
  }
  return assignment;
}

std::vector<DetectedFrame> WalkAround(const geometry::Rig& rig, int num_frames, const DetectorOptions& detector) {
  Rng rng(4);
  std::vector<DetectedFrame> frames;
  for (int f = 0; f < num_frames; ++f) {
    Walker walker;
    const double t = 2 * kPi * f / num_frames;
    walker.position = Eigen::Vector2d(std::cos(t), std::sin(t));
    walker.heading = t + kPi / 2, walker.phase = 8 * t, walker.arm_left = 0.4 * std::sin(8 * t);
    walker.arm_right = -walker.arm_left;
    frames.push_back(Detect(rig, {walker}, f, detector, &rng).frame);
  }
  return frames;
}

DetectorOptions Alone() {
  DetectorOptions detector;
  detector.false_people = 0;
  return detector;
}

/// Of the pairs whose joints are more than `limit_px` apart in `truth`, the fraction that is not as it is there.
double WrongPairs(const std::vector<DetectedFrame>& frames, const std::vector<DetectedFrame>& truth, const Pairs& pairs,
                  double limit_px) {
  int wrong = 0, wide = 0;
  for (size_t f = 0; f < frames.size(); ++f) {
    for (size_t c = 0; c < frames[f].people.size(); ++c) {
      for (size_t p = 0; p < frames[f].people[c].size(); ++p) {
        for (const auto& [l, r] : pairs) {
          const Keypoint &left = truth[f].people[c][p][l], &right = truth[f].people[c][p][r];
          if (!(left.score > 0) || !(right.score > 0) || !((left.px - right.px).norm() > limit_px)) continue;
          ++wide, wrong += frames[f].people[c][p][l].px != left.px;
        }
      }
    }
  }
  return wrong / std::max(1.0, static_cast<double>(wide));
}

const MirrorGroups& Body25Groups() {
  static const MirrorGroups groups = geometry::MirrorGroups(geometry::SkeletonByName("body25"));
  return groups;
}

TEST(FixSides, CleanTakeStaysAsItIs) {
  const geometry::Rig rig = MakeRing(4, 5, {0, 0, 1});
  const auto truth = WalkAround(rig, 100, Alone());
  auto frames = truth;
  const SideReport report = FixSides(Prepare(rig), OnePerson(frames), Body25Groups(), {}, {}, &frames);
  EXPECT_EQ(report.num_swapped, 0);
  EXPECT_EQ(WrongPairs(frames, truth, Flatten(Body25Groups()), 0), 0);
  for (const CameraSides& camera : report.cameras) EXPECT_TRUE(camera.message.empty());
  EXPECT_NEAR(report.sigma_px, 3, 1);
}

TEST(FixSides, NamesTheCameraThatSwapsThroughout) {
  for (const int num_cameras : {3, 4, 8}) {
    const geometry::Rig rig = MakeRing(num_cameras, 5, {0, 0, 1});
    const auto truth = WalkAround(rig, 100, Alone());
    auto frames = truth;
    int num_swapped = 0;
    for (DetectedFrame& frame : frames) {
      for (DetectedPerson& person : frame.people[2]) Mirror(Flatten(Body25Groups()), &person), ++num_swapped;
    }
    const SideReport report = FixSides(Prepare(rig), OnePerson(frames), Body25Groups(), {}, {}, &frames);
    EXPECT_GE(report.cameras[2].num_swapped, 0.85 * num_swapped);
    EXPECT_THAT(report.cameras[2].message, ::testing::StartsWith("cam_2: left and right swapped in "));
    EXPECT_EQ(report.num_swapped, report.cameras[2].num_swapped) << num_cameras;
    // Where left and right are well apart in the image, all is as it was.
    EXPECT_LE(WrongPairs(frames, truth, Flatten(Body25Groups()), 40), num_cameras == 3 ? 0.03 : 0.02) << num_cameras;
  }
}

TEST(FixSides, BurstsOfTwoCamerasAndPartsOfABody) {
  const geometry::Rig rig = MakeRing(6, 5, {0, 0, 1});
  const auto truth = WalkAround(rig, 120, Alone());
  auto frames = truth;
  std::set<int> swapped_1, swapped_4;
  for (DetectedFrame& frame : frames) {
    const bool burst_1 = frame.frame >= 20 && frame.frame < 50, burst_4 = frame.frame >= 40 && frame.frame < 70;
    if (burst_1 && !frame.people[1].empty()) {
      Mirror(Flatten(Body25Groups()), &frame.people[1][0]), swapped_1.insert(frame.frame);
    }
    if (burst_4 && !frame.people[4].empty()) Mirror(Body25Groups()[2], &frame.people[4][0]), swapped_4.insert(frame.frame);
  }
  const SideReport report = FixSides(Prepare(rig), OnePerson(frames), Body25Groups(), {}, {}, &frames);
  for (const int f : report.cameras[1].frames) EXPECT_EQ(swapped_1.count(f), 1u);
  for (const int f : report.cameras[4].frames) EXPECT_EQ(swapped_4.count(f), 1u);
  EXPECT_GE(report.cameras[1].frames.size(), 0.8 * static_cast<double>(swapped_1.size()));
  EXPECT_GE(report.cameras[4].frames.size(), 0.8 * static_cast<double>(swapped_4.size()));
  EXPECT_EQ(report.cameras[4].num_partly, report.cameras[4].num_swapped);
  EXPECT_EQ(report.num_swapped, report.cameras[1].num_swapped + report.cameras[4].num_swapped);
  EXPECT_LE(WrongPairs(frames, truth, Flatten(Body25Groups()), 40), 0.02);
}

TEST(FixSides, TwoCamerasAloneDecideNothing) {
  const geometry::Rig rig = MakeRing(5, 5, {0, 0, 1});
  geometry::Rig two;
  two.cameras = {rig.cameras[0], rig.cameras[1]};
  auto frames = WalkAround(two, 40, Alone());
  for (DetectedFrame& frame : frames) {
    for (DetectedPerson& person : frame.people[1]) Mirror(Flatten(Body25Groups()), &person);
  }
  const auto before = frames;
  const SideReport report = FixSides(Prepare(two), OnePerson(frames), Body25Groups(), {}, {}, &frames);
  EXPECT_EQ(report.num_swapped, 0);
  EXPECT_GT(report.num_undecided, 10);
  EXPECT_EQ(WrongPairs(frames, before, Flatten(Body25Groups()), 0), 0);
}

// In every other frame only two cameras see the person; the others' verdict on camera 1 settles these.
TEST(FixSides, RecordOfACameraSettlesTies) {
  const geometry::Rig rig = MakeRing(4, 5, {0, 0, 1});
  auto frames = WalkAround(rig, 100, Alone());
  for (DetectedFrame& frame : frames) {
    for (DetectedPerson& person : frame.people[1]) Mirror(Flatten(Body25Groups()), &person);
    if (frame.frame % 2) frame.people[2].clear(), frame.people[3].clear();
  }
  const SideReport report = FixSides(Prepare(rig), OnePerson(frames), Body25Groups(), {}, {}, &frames);
  EXPECT_EQ(report.num_swapped, report.cameras[1].num_swapped);
  EXPECT_GE(report.cameras[1].num_swapped, 65);
}

TEST(FixSides, SameForAnyNumberOfThreadsAndEmptyInput) {
  const geometry::Rig rig = MakeRing(4, 5, {0, 0, 1});
  auto one = WalkAround(rig, 30, Alone());
  for (DetectedFrame& frame : one) {
    for (DetectedPerson& person : frame.people[3]) Mirror(Flatten(Body25Groups()), &person);
  }
  auto four = one;
  RunContext run;
  run.num_threads = 1;
  const SideReport a = FixSides(Prepare(rig), OnePerson(one), Body25Groups(), {}, run, &one);
  run.num_threads = 4;
  const SideReport b = FixSides(Prepare(rig), OnePerson(four), Body25Groups(), {}, run, &four);
  EXPECT_EQ(a.cameras[3].frames, b.cameras[3].frames);
  EXPECT_EQ(WrongPairs(one, four, Flatten(Body25Groups()), 0), 0);
  std::vector<DetectedFrame> none;
  EXPECT_EQ(FixSides(Prepare(rig), {}, Body25Groups(), {}, {}, &none).num_swapped, 0);
  EXPECT_EQ(FixSides(Prepare(rig), OnePerson(one), {}, {}, {}, &one).num_swapped, 0);
}

// Two people; the association must give the mirrored detections to their owners first.
TEST(FixSides, AmongSeveralPeople) {
  const geometry::Rig rig = MakeRing(5, 5, {0, 0, 1});
  Rng rng(8);
  const Pairs pairs = Flatten(Body25Groups());
  std::vector<DetectedFrame> frames;
  int num_swapped = 0;
  for (int f = 0; f < 60; ++f) {
    std::vector<Walker> walkers(2);
    for (int i = 0; i < 2; ++i) {
      walkers[i].position = {i ? 0.8 : -0.8, f / 60.0 - 0.5};
      walkers[i].heading = i ? f * 0.1 : 2 - f * 0.1, walkers[i].phase = f * 0.3 + i;
    }
    frames.push_back(Detect(rig, walkers, f, Alone(), &rng).frame);
    for (DetectedPerson& person : frames.back().people[3]) Mirror(pairs, &person), ++num_swapped;
  }
  AssociationOptions options;
  options.max_persons = 2, options.mirror = pairs;
  const PreparedRig prepared = Prepare(rig);
  const auto assignment = AssociateTake(prepared, frames, options, {});
  const SideReport report = FixSides(prepared, assignment, Body25Groups(), {}, {}, &frames);
  EXPECT_GE(report.cameras[3].num_swapped, 0.8 * num_swapped);
  EXPECT_EQ(report.num_swapped, report.cameras[3].num_swapped);
  // Once corrected they are found by themselves, and nothing is left to correct.
  options.mirror.clear();
  const SideReport again = FixSides(prepared, AssociateTake(prepared, frames, options, {}), Body25Groups(), {}, {}, &frames);
  EXPECT_LE(again.num_swapped, 2);
}

class RealSides : public ::testing::Test {
 protected:
  void SetUp() override {
    MVS_NEEDS_DATA("pose2sim");
    recording_ = LoadPose2Sim("balancing");
    frames_ = recording_.frames;
  }
  SideReport Fix() { return FixSides(Prepare(recording_.rig), OnePerson(frames_), groups_, {}, {}, &frames_); }
  Recording recording_;
  std::vector<DetectedFrame> frames_;
  const MirrorGroups groups_ = geometry::MirrorGroups(geometry::SkeletonByName("body25b"));
};

TEST_F(RealSides, CleanRecording) {
  const SideReport report = Fix();
  EXPECT_EQ(report.num_swapped, 0);
}

// Rendered people in ten cameras, 2D joints with 1 px of noise, from files that this project did not write.
TEST(PersonASides, NothingToCorrectAndEveryCameraFound) {
  MVS_NEEDS_DATA("person_a");
  const Recording recording = LoadPersonA();
  const MirrorGroups& groups = Body25Groups();
  auto frames = recording.frames;
  const PreparedRig rig = Prepare(recording.rig);
  EXPECT_EQ(FixSides(rig, OnePerson(frames), groups, {}, {}, &frames).num_swapped, 0);
  for (DetectedFrame& frame : frames) {
    for (const size_t c : {1, 6, 7}) {
      for (DetectedPerson& person : frame.people[c]) Mirror(Flatten(groups), &person);
    }
  }
  const SideReport report = FixSides(rig, OnePerson(frames), groups, {}, {}, &frames);
  for (const size_t c : {1, 6, 7}) EXPECT_GE(report.cameras[c].num_swapped, 0.95 * static_cast<double>(frames.size()));
  EXPECT_LE(WrongPairs(frames, recording.frames, Flatten(groups), 20), 0.01);
}

TEST_F(RealSides, EachCameraSwapped) {
  for (size_t c = 0; c < 4; ++c) {
    frames_ = recording_.frames;
    for (DetectedFrame& frame : frames_) {
      if (!frame.people[c].empty()) Mirror(Flatten(groups_), &frame.people[c][0]);
    }
    const SideReport report = Fix();
    EXPECT_GE(report.cameras[c].num_swapped, 99);
    EXPECT_EQ(report.num_swapped, report.cameras[c].num_swapped);
  }
}

TEST_F(RealSides, BurstsOfACamera) {
  std::set<int> swapped;
  for (DetectedFrame& frame : frames_) {
    if (frame.frame % 20 < 7 && !frame.people[1].empty()) {
      Mirror(Flatten(groups_), &frame.people[1][0]);
      swapped.insert(frame.frame);
    }
  }
  const SideReport report = Fix();
  int found = 0;
  for (const int f : report.cameras[1].frames) found += static_cast<int>(swapped.count(f));
  EXPECT_EQ(found, static_cast<int>(swapped.size()));
  EXPECT_EQ(report.num_swapped, found);
}

}  // namespace
}  // namespace mvstudio::triangulate
