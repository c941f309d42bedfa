#include "stages/people/human_shape.h"

#include <algorithm>

#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Joints of a person of 1.75 m who stands at the origin, by name, metres, z up.
Eigen::Vector3d JointOf(const std::string& name) {
  static const std::map<std::string, Eigen::Vector3d> kRight = {
      {"Shoulder", {-0.18, 0, 1.42}},    {"Elbow", {-0.3, 0, 1.17}},    {"Wrist", {-0.36, 0.05, 0.93}},
      {"Hip", {-0.1, 0, 0.93}},          {"Knee", {-0.12, 0.02, 0.5}},  {"Ankle", {-0.13, 0, 0.09}},
      {"Eye", {-0.03, 0.09, 1.64}},      {"Ear", {-0.07, 0, 1.62}},     {"BigToe", {-0.12, 0.16, 0.02}},
      {"SmallToe", {-0.18, 0.13, 0.02}}, {"Heel", {-0.13, -0.05, 0.03}}};
  if (name == "Nose") return {0, 0.1, 1.6};
  if (name == "Neck") return {0, 0, 1.43};
  if (name == "Head") return {0, 0, 1.78};
  if (name == "MidHip") return {0, 0, 0.93};
  Eigen::Vector3d x = kRight.at(name.substr(1));
  if (name[0] == 'L') x.x() = -x.x();
  return x;
}

/// 30 frames of that person in the order of `skeleton`, moved by `transform` and a little noise.
template <class Transform>
triangulate::TakeResult Take(const std::string& skeleton, const Transform& transform) {
  Rng rng(1);
  triangulate::TakeResult take;
  const auto& joints = geometry::SkeletonByName(skeleton).joints;
  for (int f = 0; f < 30; ++f) {
    for (size_t j = 0; j < joints.size(); ++j) {
      triangulate::TakePoint point;
      point.frame = f, point.joint_idx = static_cast<int>(j);
      point.point.status = Status::kOk;
      const Eigen::Vector3d noise(rng.Normal(), rng.Normal(), rng.Normal());
      point.point.x_in_world = transform(Eigen::Vector3d(JointOf(joints[j]) + 0.02 * noise));
      take.points.push_back(point);
    }
  }
  return take;
}

Eigen::Vector3d Same(const Eigen::Vector3d& x) { return x; }

PoseInput InputOf(const std::string& skeleton, const std::string& gauge = "the board in frame 0") {
  PoseInput input;
  input.skeleton = geometry::SkeletonByName(skeleton);
  input.limbs = LimbsOf(input.skeleton);
  input.rig.gauge = geometry::GaugeFromText(gauge);
  return input;
}

CommandResult Limbs(const triangulate::TakeResult& take, const PoseInput& input) {
  return DescribeLimbs(JudgeLimbs(take, input), input.skeleton.name);
}

CommandResult Up(const triangulate::TakeResult& take, const PoseInput& input) {
  return DescribeUp(TrunkTiltDeg(take.points, input.skeleton), input.rig, "");
}

TEST(CheckLimbs, JointsReadAsTheWrongSkeletonFailAndTheRightOneIsNamed) {
  for (const auto& [read, written] : {std::pair("body25", "body25b"), {"body25b", "body25"}}) {
    const CommandResult result = Limbs(Take(written, Same), InputOf(read));
    EXPECT_EQ(result.exit, kExitQualityGate) << read;
    ASSERT_EQ(result.errors.size(), 1u) << read;
    EXPECT_EQ(result.errors[0].code, "TRI-SKELETON");
    EXPECT_THAT(result.errors[0].hint, HasSubstr(std::string("skeleton' ") + written));
  }
}

TEST(CheckLimbs, PeopleOfAllSizesPass) {
  for (const double size : {0.45, 0.7, 1.0, 1.2}) {
    const auto scaled = [size](const Eigen::Vector3d& x) { return Eigen::Vector3d(size * x); };
    const CommandResult result = Limbs(Take("body25", scaled), InputOf("body25"));
    EXPECT_EQ(result.exit, kExitOk);
    EXPECT_THAT(result.warnings, IsEmpty()) << size << " " << result.warnings[0].text;
  }
}

TEST(CheckLimbs, AnotherUnitIsAWarningOfScale) {
  const auto in_mm = [](const Eigen::Vector3d& x) { return Eigen::Vector3d(1000 * x); };
  const CommandResult result = Limbs(Take("body25", in_mm), InputOf("body25"));
  EXPECT_EQ(result.exit, kExitOk);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "TRI-SCALE");
}

TEST(CheckLimbs, WhatNoSkeletonExplainsIsAWarning) {
  // One side stretched: as by a camera whose calibration is wrong.
  const auto stretch = [](const Eigen::Vector3d& x) { return Eigen::Vector3d(x.x(), x.y(), x.x() < 0 ? 2 * x.z() : x.z()); };
  const CommandResult result = Limbs(Take("body25", stretch), InputOf("body25"));
  EXPECT_EQ(result.exit, kExitOk);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "TRI-LIMBS");
  EXPECT_THAT(result.warnings[0].text, HasSubstr("LHip-LKnee"));
}

TEST(CheckLimbs, BonesOfAnOwnSkeletonHaveTheRangesOfItsFile) {
  PoseInput input = InputOf("body25");
  const auto stretch = [](const Eigen::Vector3d& x) { return Eigen::Vector3d(x.x(), x.y(), 3 * x.z()); };
  input.skeleton.human = false, input.skeleton.name = "giraffe";  // no limb is judged as people's
  CommandResult free, limited;
  free.Add(Limbs(Take("body25", stretch), input));
  EXPECT_THAT(free.warnings, IsEmpty());
  EXPECT_EQ(LimbsOf(input.skeleton).size(), input.skeleton.bones.size());
  input.skeleton.lengths.assign(input.skeleton.bones.size(), {});
  const auto bone = std::find(input.skeleton.bones.begin(), input.skeleton.bones.end(),
                              std::pair(input.skeleton.Find("LHip"), input.skeleton.Find("LKnee")));
  ASSERT_NE(bone, input.skeleton.bones.end());
  input.skeleton.lengths[static_cast<size_t>(bone - input.skeleton.bones.begin())] = {0.2, 1.2};
  limited.Add(Limbs(Take("body25", stretch), input));
  ASSERT_EQ(limited.warnings.size(), 1u);
  EXPECT_EQ(limited.warnings[0].code, "TRI-LIMBS");
  EXPECT_THAT(limited.warnings[0].text,
              AllOf(HasSubstr("giraffe"), HasSubstr("LHip-LKnee is 12"), HasSubstr("not 200 to 1200 mm")));
}

TEST(CheckUp, AnOwnSkeletonSaysWhatIsUp) {
  PoseInput input = InputOf("body25");
  input.skeleton.human = false;
  input.skeleton.up_from = {input.skeleton.Find("Neck")}, input.skeleton.up_to = {input.skeleton.Find("MidHip")};
  CommandResult down, unsaid;
  down.Add(Up(Take("body25", Same), input));
  EXPECT_NEAR(down.metrics["world"]["trunk_tilt_deg"].get<double>(), 180, 3);
  ASSERT_EQ(down.warnings.size(), 1u);
  input.skeleton.up_from.clear();
  unsaid.Add(Up(Take("body25", Same), input));
  EXPECT_TRUE(unsaid.metrics["world"]["trunk_tilt_deg"].is_null());
}

TEST(ImpossibleLimbs, NamesBothLengthsAndNeedsBoth) {
  EXPECT_THAT(ImpossibleLimbs({{"RHip-RKnee", 1.042}}), IsEmpty());
  EXPECT_THAT(ImpossibleLimbs({{"RHip-RKnee", 1.042}, {"RKnee-RAnkle", 0.41}}),
              ElementsAre("RHip-RKnee 1042 mm beside RKnee-RAnkle 410 mm"));
  EXPECT_THAT(ImpossibleLimbs({}), IsEmpty());
}

TEST(CheckUp, SaysWhatFixesTheWorldAndWarnsOfPeopleWhoLie) {
  const auto lie = [](const Eigen::Vector3d& x) { return Eigen::Vector3d(x.z(), x.x(), x.y()); };
  CommandResult standing, lying, few;
  standing.Add(Up(Take("coco17", Same), InputOf("coco17")));
  EXPECT_NEAR(standing.metrics["world"]["trunk_tilt_deg"].get<double>(), 0, 3);
  EXPECT_THAT(standing.warnings, IsEmpty());
  lying.Add(Up(Take("coco17", lie), InputOf("coco17", "camera cam_01")));
  EXPECT_NEAR(lying.metrics["world"]["trunk_tilt_deg"].get<double>(), 90, 3);
  ASSERT_EQ(lying.warnings.size(), 1u);
  EXPECT_THAT(lying.warnings[0].text, HasSubstr("camera cam_01"));
  triangulate::TakeResult short_take = Take("coco17", lie);
  short_take.points.resize(17 * 5);
  few.Add(Up(short_take, InputOf("coco17")));
  EXPECT_TRUE(few.metrics["world"]["trunk_tilt_deg"].is_null());
}

TEST(WorldText, OnlyAWorldThatSomebodySetIsZUp) {
  EXPECT_THAT(WorldText(InputOf("coco17").rig), HasSubstr("z up; fixed by the board in frame 0"));
  EXPECT_THAT(WorldText(InputOf("coco17", "camera cam_01").rig), HasSubstr("axes of camera cam_01"));
  EXPECT_THAT(WorldText(InputOf("coco17", "").rig), HasSubstr("does not say"));
}

}  // namespace
}  // namespace mvstudio::stages
