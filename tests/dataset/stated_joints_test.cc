#include <fstream>

#include "core/error.h"
#include "dataset/pose/pose2d.h"
#include "geometry/skeleton/skeleton_text.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Files of 2D poses that name their joints: the names decide, not the number of joints.
namespace mvstudio::dataset {
namespace {

/// PoseTrack's 17 joints, as many as COCO's.
const std::vector<std::string> kPoseTrack = {"nose",          "head_bottom",    "head_top",   "left_ear",    "right_ear",
                                             "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist",
                                             "right_wrist",   "left_hip",       "right_hip",  "left_knee",   "right_knee",
                                             "left_ankle",    "right_ankle"};

class StatedJoints : public ::testing::Test {
 protected:
  std::string Put(const std::string& text, const std::string& name = "cam.json") const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  static std::string Quoted(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "\"" : ",\"") + name + "\"";
    return "[" + text + "]";
  }
  /// Joint k stands at x = 100 + k, y = 5.
  static std::string Flat(size_t count) {
    std::string text;
    for (size_t k = 0; k < count; ++k) text += (k ? "," : "") + std::to_string(100 + k) + ",5,0.5";
    return "[" + text + "]";
  }
  static std::string Coco(const std::vector<std::string>& names, const std::string& bones = "[]") {
    return R"({"images":[{"id":9,"file_name":"a_000003.jpg"}],"annotations":[{"image_id":9,"keypoints":)" + Flat(names.size()) +
           R"(}],"categories":[{"id":1,"name":"person","keypoints":)" + Quoted(names) + R"(,"skeleton":)" + bones + "}]}";
  }
  /// The person's x of a joint of the skeleton.
  static double X(const Pose2dTrack& track, const geometry::Skeleton& skeleton, const std::string& joint) {
    return track.frames.at(3).at(0).keypoints.at(static_cast<size_t>(skeleton.Find(joint))).x_px;
  }
  testing::TempDir folder_;
};

TEST_F(StatedJoints, AnotherOrderOfAsManyJointsIsNotTakenForCoco) {
  const std::string path = Put(Coco(kPoseTrack, "[[1,2],[2,3],[2,1],[0,4],[18,1]]"));
  const std::string why =
      testing::MessageOf<FormatError>([&] { ReadPoseResults(path, "a", geometry::SkeletonByName("coco17")); });
  EXPECT_THAT(why, AllOf(HasSubstr("head_bottom"), HasSubstr("`LEye` of skeleton coco17"), HasSubstr("option 'skeleton' out")));
  const auto stated = SkeletonStatedIn(path);
  ASSERT_TRUE(stated);
  EXPECT_EQ(stated->joints, kPoseTrack);
  EXPECT_THAT(stated->bones, ElementsAre(std::pair(0, 1), std::pair(1, 2)))
      << "each once, and none of joints that are not there";
  const Pose2dTrack track = ReadPoseResults(path, "a", *stated);
  EXPECT_EQ(X(track, *stated, "head_top"), 102);
  EXPECT_EQ(X(track, *stated, "right_ankle"), 116);
}

TEST_F(StatedJoints, OfCocoInAnotherOrderAreFoundByTheirNames) {
  const geometry::Skeleton& coco = geometry::SkeletonByName("coco17");
  std::vector<std::string> turned;
  for (const std::string& joint : coco.joints) turned.insert(turned.begin(), geometry::JointKey(joint));
  const std::string path = Put(Coco(turned));
  const auto stated = SkeletonStatedIn(path);
  ASSERT_TRUE(stated);
  EXPECT_EQ(stated->name, "coco17");
  const Pose2dTrack track = ReadPoseResults(path, "a", *stated);
  EXPECT_EQ(X(track, coco, "Nose"), 116);
  EXPECT_EQ(X(track, coco, "RAnkle"), 100);
}

TEST_F(StatedJoints, OfMmposeAndOfKeypointsWithNames) {
  const std::string instance = R"([{"keypoints":[[1,5],[2,5],[3,5]],"keypoint_scores":[0.5,0.6,0.7]}])";
  const std::string mmpose = R"({"meta_info":{"keypoint_id2name":{"0":"root","1":"right_hip","2":"right_knee"}},)"
                             R"("instance_info":[{"frame_id":3,"instances":)" +
                             instance + "}]}";
  auto stated = SkeletonStatedIn(Put(mmpose));
  ASSERT_TRUE(stated);
  EXPECT_THAT(stated->joints, ElementsAre("root", "right_hip", "right_knee"));
  EXPECT_EQ(X(ReadPoseResults(folder_ / "cam.json", "a", *stated), *stated, "right_knee"), 3);
  const geometry::Skeleton knee = geometry::PointsSkeleton({"RKnee"});
  EXPECT_EQ(X(ReadPoseResults(folder_ / "cam.json", "a", knee), knee, "RKnee"), 3) << "a part of the file's joints";
  Put(R"({"meta_info":{"keypoint_id2name":{"0":"root","1":"right_hip","2":"right_knee"}},"instance_info":)" + instance + "}",
      "000003.json");
  std::filesystem::remove(folder_ / "cam.json");
  EXPECT_EQ(X(ReadOpenPoseFolder(folder_.path(), "a", knee), knee, "RKnee"), 3) << "a file of one image";

  const std::string named = R"([{"frame":3,"keypoints":[{"name":"left_knee","x":7,"y":8,"score":0.9},)"
                            R"({"part":"nose","position":{"x":4,"y":5},"confidence":0.2}]}])";
  stated = SkeletonStatedIn(Put(named, "named.json"));
  ASSERT_TRUE(stated);
  EXPECT_THAT(stated->joints, ElementsAre("left_knee", "nose"));
  const geometry::Skeleton both = geometry::PointsSkeleton({"Nose", "LKnee"});
  const Pose2dTrack track = ReadPoseResults(folder_ / "named.json", "a", both);
  EXPECT_EQ(X(track, both, "Nose"), 4);
  EXPECT_EQ(track.frames.at(3)[0].keypoints[0].score, 0.2);
  EXPECT_EQ(X(track, both, "LKnee"), 7);
}

/// Detectors list the joints that they see: nobody's list is the skeleton.
TEST_F(StatedJoints, TheJointsOfAllPeopleAreTheSkeleton) {
  const std::string path = Put(R"([{"frame":3,"keypoints":[{"name":"nose","x":4,"y":5,"score":0.5}]},)"
                               R"({"frame":4,"keypoints":[{"name":"left_knee","x":7,"y":8,"score":0.9},)"
                               R"({"name":"nose","x":6,"y":5,"score":0.5}]}])");
  const auto stated = SkeletonStatedIn(path);
  ASSERT_TRUE(stated);
  EXPECT_THAT(stated->joints, ElementsAre("nose", "left_knee"));
  const Pose2dTrack track = ReadPoseResults(path, "a", *stated);
  EXPECT_TRUE(track.skipped.empty());
  EXPECT_EQ(X(track, *stated, "nose"), 4);
  EXPECT_EQ(track.frames.at(3)[0].keypoints[1].score, 0);
  EXPECT_EQ(track.frames.at(4)[0].keypoints[1].x_px, 7);
  const geometry::Skeleton& coco = geometry::SkeletonByName("coco17");
  EXPECT_EQ(X(ReadPoseResults(path, "a", coco), coco, "Nose"), 4) << "the others were not detected";
  EXPECT_EQ(ReadPoseResults(path, "a", coco).frames.at(3)[0].keypoints.size(), 17u);
  const geometry::Skeleton other = geometry::PointsSkeleton({"tail"});
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { ReadPoseResults(path, "a", other); }), HasSubstr("`tail`"));
}

TEST_F(StatedJoints, NamesThatOnlyCountSayNothing) {
  EXPECT_FALSE(SkeletonStatedIn(Put(Coco({"kp_0", "kp_1", "kp_2"}))));
  const geometry::Skeleton three = geometry::PointsSkeleton({"a", "b", "c"});
  EXPECT_EQ(X(ReadPoseResults(folder_ / "cam.json", "a", three), three, "c"), 102);
  EXPECT_FALSE(SkeletonStatedIn(Put(R"([{"image_id":3,"keypoints":[1,2,0.5]}])")));
  EXPECT_FALSE(SkeletonStatedIn(Put(R"({"keypoints":{"name)"))) << "a damaged file";
}

/// OpenPifPaf writes a line of JSON for each image of a video.
TEST_F(StatedJoints, JsonOfLinesIsAList) {
  std::string lines;
  for (int frame = 2; frame < 5; ++frame)
    lines += R"({"frame":)" + std::to_string(frame) + R"(,"predictions":[)" +
             (frame == 4 ? "" : R"({"keypoints":)" + Flat(17) + R"(,"score":0.8})") + "]}\n";
  const Pose2dTrack track = ReadPoseResults(Put(lines), "a", geometry::SkeletonByName("coco17"));
  EXPECT_EQ(track.frames.size(), 3u);
  EXPECT_TRUE(track.frames.at(4).empty());
  EXPECT_EQ(X(track, geometry::SkeletonByName("coco17"), "RAnkle"), 116);
}

}  // namespace
}  // namespace mvstudio::dataset
