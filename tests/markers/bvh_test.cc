#include "dataset/markers/bvh.h"

#include <sstream>

#include "geometry/skeleton/skeleton_text.h"
#include "tests/support/mouse.h"
#include "tests/support/test.h"

namespace mvstudio::markers {
namespace {

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

geometry::Skeleton Mouse() { return geometry::SkeletonFromToml(testing::MouseToml(), "mouse.toml"); }

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

/// A standing person in these joints; y is sideways, z up.
MarkerTake PersonTake(const geometry::Skeleton& skeleton) {
  MarkerTake take;
  take.rate_hz = 50, take.names = skeleton.joints;
  for (int f = 0; f < 4; ++f) {
    for (const std::string& joint : skeleton.joints) {
      const double side = joint[0] == 'L' ? 0.2 : joint[0] == 'R' ? -0.2 : 0;
      const auto has = [&](const char* word) { return joint.find(word) != std::string::npos; };
      const double height = has("Hip") ? 0.9 : has("Knee") ? 0.5 : has("Ankle") || has("Heel") || has("Toe") ? 0.1 : 1.4;
      take.x_in_world.emplace_back((has("Toe") ? 0.2 : 0) + 0.01 * f, side, height);
    }
  }
  take.source.assign(take.x_in_world.size(), Source::kMeasured);
  take.sigma_m.assign(take.x_in_world.size(), 0);
  return take;
}

TEST(PersonBvh, HangsFromThePelvis) {
  for (const char* name : {"body25", "body25b", "coco17", "halpe26"}) {
    const geometry::Skeleton& known = geometry::SkeletonByName(name);
    const MarkerBody hung = HungFromPelvis(PersonTake(known), known);
    ASSERT_EQ(hung.take.names, hung.skeleton.joints) << name;
    const auto parent = [&](const char* joint) {
      const int p = hung.skeleton.parents[static_cast<size_t>(hung.skeleton.Find(joint))];
      return p < 0 ? std::string("-") : hung.skeleton.joints[static_cast<size_t>(p)];
    };
    EXPECT_EQ(parent("MidHip"), "-") << name;
    EXPECT_EQ(parent("LHip"), "MidHip") << name;
    EXPECT_EQ(parent("RKnee"), "RHip") << name;
    EXPECT_EQ(parent("LElbow"), "LShoulder") << name;
    EXPECT_NE(parent("Nose"), "MidHip") << name;
    const BvhMotion motion = FitBvh(hung.take, hung.skeleton);
    EXPECT_LT(motion.max_m, 1e-8) << name;  // angles are good to the root of the machine's precision
    EXPECT_THAT(BvhText(motion, hung.skeleton, 50), HasSubstr("ROOT MidHip\n")) << name;
    for (int f = 0; f < hung.take.num_frames(); ++f) {
      const int hip = hung.skeleton.Find("MidHip");
      EXPECT_NEAR(hung.take.x_in_world[hung.take.Index(f, hip)].z(), 0.9, 1e-12) << name;
    }
  }
  const MarkerBody mouse = HungFromPelvis(MouseTake(2), Mouse());
  EXPECT_EQ(mouse.skeleton.joints, Mouse().joints);
}

TEST(OwnBvh, TextHoldsAHierarchyAndAllChannels) {
  geometry::Skeleton mouse = Mouse();
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
