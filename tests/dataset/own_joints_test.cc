#include "dataset/panoptic/own_joints.h"

#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "geometry/skeleton/skeleton_text.h"
#include "tests/support/message_of.h"
#include "tests/support/mouse.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;

OwnJoints Mice() {
  OwnJoints joints;
  joints.skeleton = geometry::SkeletonFromToml(testing::MouseToml(), "mouse.toml");
  for (const int frame : {0, 7}) {
    for (const int person : {0, 3}) {
      JointsPose& pose = joints.poses[frame][person];
      pose.x_in_world.resize(3, 15);
      const auto x = testing::MouseAt(frame + 11 * person);
      for (size_t j = 0; j < 15; ++j) pose.x_in_world.col(static_cast<Eigen::Index>(j)) = x[j] / 3;
      pose.valid.assign(15, true), pose.confidence.assign(15, 0.1 + 0.2);
    }
  }
  joints.poses[7][3].valid[4] = false;
  return joints;
}

TEST(OwnJoints, ComeBackAsTheyWere) {
  const TempDir folder;
  EXPECT_FALSE(ReadOwnJoints(folder.path()));
  const OwnJoints mice = Mice();
  WriteOwnJoints(mice, 25, folder.path());
  EXPECT_TRUE(fs::exists(folder / "hdPose3d_stage1_mouse/body3DScene_00000007.json"));
  const auto back = ReadOwnJoints(folder.path());
  ASSERT_TRUE(back);
  EXPECT_EQ(back->skeleton.joints, mice.skeleton.joints);
  EXPECT_EQ(back->skeleton.bones, mice.skeleton.bones);
  ASSERT_EQ(back->poses.size(), 2u);
  for (const auto& [frame, people] : mice.poses) {
    ASSERT_EQ(back->poses.at(frame).size(), 2u);
    for (const auto& [id, pose] : people) {
      const JointsPose& read = back->poses.at(frame).at(id);
      EXPECT_EQ(read.valid, pose.valid);
      for (int j = 0; j < 15; ++j) {
        if (!pose.valid[static_cast<size_t>(j)]) continue;
        EXPECT_LT((read.x_in_world.col(j) - pose.x_in_world.col(j)).norm(), 1e-15) << j;
      }
    }
  }
  EXPECT_EQ(back->poses.at(0).at(0).confidence[0], 0.1 + 0.2);
}

TEST(OwnJoints, DamageIsNamed) {
  const TempDir folder;
  WriteOwnJoints(Mice(), 25, folder.path());
  const std::string inside = folder / "hdPose3d_stage1_mouse", scene = inside + "/body3DScene_00000000.json";
  const auto message = [&](const std::string& text) {
    std::ofstream(scene) << text;
    return MessageOf<FormatError>([&] { ReadOwnJoints(folder.path()); });
  };
  EXPECT_THAT(message("{"), HasSubstr(scene));
  EXPECT_THAT(message("{\"bodies\": [{\"id\": 0}]}"), HasSubstr("bodies[0].joints15: is missing"));
  EXPECT_THAT(message("{\"bodies\": [{\"id\": 0, \"joints15\": [1]}]}"), HasSubstr("must hold 60 numbers"));
  fs::copy(inside, folder / "hdPose3d_stage1_rat");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadOwnJoints(folder.path()); }), HasSubstr("joints of two skeletons"));
  fs::remove_all(folder / "hdPose3d_stage1_rat");
  std::ofstream(inside + "/skeleton.json") << "{\"name\": \"mouse\", \"joints\": []}";
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadOwnJoints(folder.path()); }),
              HasSubstr("skeleton.json: joints: names no joint"));
}

}  // namespace
}  // namespace mvstudio::dataset
