#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/error.h"
#include "dataset/pose/pose2d.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// 2D joints as further programs write them, and what is said of those that are not read.
namespace mvstudio::dataset {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class Pose2dPrograms : public ::testing::Test {
 protected:
  void Put(const std::string& name, const std::string& content) const { std::ofstream(folder_ / name) << content; }
  template <class E>
  std::string Message() const {
    return testing::MessageOf<E>([&] { ReadOpenPoseFolder(folder_.path(), "cam_03", geometry::SkeletonByName("coco17")); });
  }
  Pose2dTrack ReadText(const std::string& text) const {
    Put("results.json", text);
    return ReadPose2d(folder_ / "results.json", "cam_03", geometry::SkeletonByName("coco17"));
  }
  static std::string Numbers(int count, double first) {
    std::string text = "[";
    for (int i = 0; i < count; ++i) text += (i ? "," : "") + std::to_string(first + i);
    return text + "]";
  }
  testing::TempDir folder_;
};

TEST_F(Pose2dPrograms, FilesOfLabelProgramsAreNamed) {
  Put("1.json", "<annotations/>");
  EXPECT_THAT(Message<FormatError>(), AllOf(HasSubstr("XML, no JSON"), HasSubstr("COCO Keypoints")));
  Put("1.json", "frame;nose_x;nose_y\n");
  EXPECT_THAT(Message<FormatError>(), HasSubstr("a text, no JSON"));
}

/// Ultralytics' `class cx cy w h`, then x y v of each joint as shares, then a confidence and a track; none, one or two people.
TEST_F(Pose2dPrograms, YoloLabelsAreSharesOfTheImage) {
  std::string with_v = "0 0.5 0.5 0.25 0.5", without_v = with_v, pixels = with_v;
  for (int k = 0; k < 17; ++k) {
    with_v += " 0." + std::to_string(10 + k) + " 0.25 " + std::to_string(k % 3);
    pixels += " 640 360 2";
    without_v += k == 4 ? " 0 0" : " 0." + std::to_string(10 + k) + " 0.5";
  }
  Put("take_1.txt", with_v + "\n" + with_v + " 0.9 3\n");
  Put("take_2.txt", without_v + "\n");
  Put("take_3.txt", "");
  const auto read = [&] { return ReadPose2d(folder_.path(), "cam_03", geometry::SkeletonByName("coco17")); };
  const Pose2dTrack track = read();
  EXPECT_TRUE(track.normalized);
  ASSERT_EQ(track.frames.size(), 3u);
  ASSERT_EQ(track.frames.at(1).size(), 2u);
  const auto& joints = track.frames.at(1)[1].keypoints;
  EXPECT_EQ(joints[2].x_px, 0.12);
  EXPECT_EQ(joints[2].y_px, 0.25);
  EXPECT_EQ(joints[0].score, 0) << "not labelled";
  EXPECT_EQ(joints[1].score, 1) << "hidden";
  EXPECT_EQ(joints[2].score, 1);
  EXPECT_EQ(track.frames.at(2)[0].keypoints[4].score, 0);
  EXPECT_EQ(track.frames.at(2)[0].keypoints[5].score, 1);
  EXPECT_TRUE(track.frames.at(3).empty());
  for (const auto& [text, why] : {std::pair<std::string, std::string>("0 0.5 0.5 0.2 0.2", "a box without joints"),
                                  {"0 0.5 0.5 0.2 0.2 0.1 0.1 2 0.1 0.1 2", "11 numbers, not 5 + 3 x 17"},
                                  {"0 0.5 x", "`x` is no number"},
                                  {pixels, "is not at 0 to 1"}}) {
    for (const char* name : {"take_1.txt", "take_2.txt", "take_3.txt"}) Put(name, text);
    EXPECT_THAT(testing::MessageOf<FormatError>(read), HasSubstr(why));
  }
}

/// {"0007.jpg": {"bodies": […]}} and {"0007.jpg": {"people": […]}}; older MMPose has [[x, y, score], …] for each image.
TEST_F(Pose2dPrograms, AlphaPosesOtherFormatsAndTriples) {
  for (const auto& [list, joints] : {std::pair("bodies", "joints"), std::pair("people", "pose_keypoints_2d")}) {
    const Pose2dTrack track =
        ReadText(std::string("{\"f_0007.jpg\":{\"") + list + "\":[{\"" + joints + "\":" + Numbers(51, 1) +
                 "}]},\"f_0008.jpg\":{\"" + list + "\":[{\"" + joints + "\":" + Numbers(51, 100) + "}]}}");
    ASSERT_EQ(track.frames.size(), 2u) << list;
    EXPECT_EQ(track.frames.at(7)[0].keypoints[1].x_px, 4);
    EXPECT_EQ(track.frames.at(8)[0].keypoints[0].y_px, 101);
  }
  std::string triples;
  for (int k = 0; k < 17; ++k) triples += (k ? ",[" : "[") + std::to_string(k) + ",5,0.5]";
  EXPECT_EQ(ReadText("[{\"image_id\":3,\"keypoints\":[" + triples + "]}]").frames.at(3)[0].keypoints[16].x_px, 16);
}

/// easy_ViTPose states y before x, and the order of its joints; `coco_25` has joints that coco17 lacks between its others.
TEST_F(Pose2dPrograms, EasyViTPoseIsYBeforeXAndByItsNames) {
  const std::vector<std::string> names = {"neck",       "nose",          "left_eye",       "right_eye",  "left_ear",
                                          "right_ear",  "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
                                          "left_wrist", "right_wrist",   "left_hip",       "right_hip",  "left_knee",
                                          "right_knee", "left_ankle",    "right_ankle"};
  std::string points, skeleton;
  for (size_t k = 0; k < names.size(); ++k) {
    points += (k ? ",[" : "[") + std::to_string(100 + k) + "," + std::to_string(500 + k) + ",0.5]";
    skeleton += (k ? ",\"" : "\"") + std::to_string(k) + "\":\"" + names[k] + "\"";
  }
  const auto file = [&](const std::string& first) {
    return "{\"keypoints\":[{},{\"3\":[" + points + "]}],\"skeleton\":{" + first + "}}";
  };
  const Pose2dTrack track = ReadText(file(skeleton));
  ASSERT_EQ(track.frames.count(1), 1u) << "the position in the list is the frame";
  const Person2d& person = track.frames.at(1).at(0);
  ASSERT_EQ(person.keypoints.size(), 17u);
  EXPECT_EQ(person.keypoints[0].x_px, 501) << "the nose is the second of the file";
  EXPECT_EQ(person.keypoints[0].y_px, 101);
  EXPECT_EQ(person.keypoints[16].x_px, 517);
  const auto message = [&] { return testing::MessageOf<FormatError>([&] { ReadText(file("\"0\":\"nose\"")); }); };
  EXPECT_THAT(message(), AllOf(HasSubstr("LEye"), HasSubstr("coco17")));
}

TEST_F(Pose2dPrograms, ProjectsOfLabelProgramsAreNamed) {
  const auto message = [this](const std::string& text) { return testing::MessageOf<FormatError>([&] { ReadText(text); }); };
  EXPECT_THAT(message(R"({"_via_settings":{},"_via_img_metadata":{}})"), HasSubstr("a project of VIA"));
  EXPECT_THAT(message(R"([{"id":1,"data":{},"annotations":[]}])"), HasSubstr("Label Studio"));
  EXPECT_THAT(message(R"([{"frame":0,"landmarks":[]}])"), HasSubstr("MediaPipe"));
}

}  // namespace
}  // namespace mvstudio::dataset
