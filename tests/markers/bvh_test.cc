#include "markers/bvh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "body/skeleton_text.h"
#include "tests/support/mouse.h"

namespace mvstudio::markers {
namespace {

using ::testing::HasSubstr;

MarkerTake MouseTake(int frames) {
  MarkerTake take;
  take.rate_hz = 50, take.names = testing::MouseNames();
  for (int f = 0; f < frames; ++f) {
    for (const Eigen::Vector3d& x : testing::MouseAt(f)) take.x_in_world.push_back(x);
  }
  take.source.assign(take.x_in_world.size(), Source::kMeasured);
  take.sigma_m.assign(take.x_in_world.size(), 0);
  return take;
}

body::Skeleton Mouse() { return body::SkeletonFromToml(testing::MouseToml(), "mouse.toml"); }

TEST(OwnBvh, FollowsAMouseExactly) {
  const MarkerTake take = MouseTake(40);
  const BvhMotion motion = FitBvh(take, Mouse());
  EXPECT_LT(motion.max_m, 1e-9);
  EXPECT_EQ(motion.num_joints, 40 * 15);
  EXPECT_EQ(motion.num_held, 0);
  const std::vector<Eigen::Vector3d> last = BvhJoints(motion, motion.frames.back());
  const Eigen::Vector3d tail = testing::MouseAt(39).back();
  EXPECT_LT((last.back() - Eigen::Vector3d(tail.x(), tail.z(), -tail.y())).norm(), 1e-9);
}

TEST(OwnBvh, HoldsWhatIsMissingAndKeepsEveryJoint) {
  MarkerTake take = MouseTake(20);
  const auto lose = [&take](int frame, int joint) { take.x_in_world[take.Index(frame, joint)].setConstant(std::nan("")); };
  for (int j = 0; j < 15; ++j) lose(7, j);
  for (int f = 0; f < 20; ++f) lose(f, 14);  // the tail's tip is never seen
  const BvhMotion motion = FitBvh(take, Mouse());
  EXPECT_LT(motion.max_m, 1e-9);
  EXPECT_EQ(motion.num_held, 1);
  EXPECT_EQ(motion.frames[7].root, motion.frames[6].root);
  ASSERT_EQ(motion.nodes.size(), 15u);
  for (const Eigen::Vector3d& x : BvhJoints(motion, motion.frames[3])) EXPECT_TRUE(x.allFinite());
}

TEST(OwnBvh, TextHoldsAHierarchyAndAllChannels) {
  body::Skeleton mouse = Mouse();
  MarkerTake take = MouseTake(3);
  mouse.joints[3] = take.names[3] = "left ear";
  mouse.joints[4] = take.names[4] = "left_ear";  // the same without its blank
  const std::string text = BvhText(FitBvh(take, mouse), mouse, 50);
  for (const char* line :
       {"ROOT back\n", "JOINT left_ear\n", "JOINT left_ear_\n", "JOINT tail_tip\n", "Frames: 3\n", "Frame Time: 0.02\n"}) {
    EXPECT_THAT(text, HasSubstr(line));
  }
  std::istringstream lines(text.substr(text.find("Frame Time")));
  std::string line;
  std::getline(lines, line);
  int frames = 0;
  while (std::getline(lines, line)) {
    std::istringstream numbers(line);
    double value = 0;
    int count = 0;
    while (numbers >> value) ++count;
    EXPECT_EQ(count, 3 + 3 * 15);
    ++frames;
  }
  EXPECT_EQ(frames, 3);
}

TEST(OwnBvh, NobodyIsAnEmptyMotion) {
  MarkerTake take = MouseTake(0);
  const BvhMotion motion = FitBvh(take, Mouse());
  EXPECT_EQ(motion.nodes.size(), 15u);
  EXPECT_TRUE(motion.frames.empty());
}

}  // namespace
}  // namespace mvstudio::markers
