#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "dataset/pose/pose2d.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::dataset {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kHeader[] = "camera,frame,person,joint,x_px,y_px,score\n";

class Pose2dCsv : public ::testing::Test {
 protected:
  Pose2dSet ReadText(const std::string& text, const geometry::Skeleton* skeleton = nullptr) const {
    std::ofstream(folder_ / "points.csv") << text;
    return ReadPose2dCsv(folder_ / "points.csv", skeleton);
  }
  std::string Message(const std::string& text, const geometry::Skeleton* skeleton = nullptr) const {
    return testing::MessageOf<FormatError>([&] { ReadText(text, skeleton); });
  }
  testing::TempDir folder_;
};

TEST_F(Pose2dCsv, ColumnsHaveOtherProgramsNames) {
  const Pose2dSet set = ReadText("camera,frame,joint,x,y,likelihood\na,0,nose,10,20,0.25\nb,0,nose,30,40,0.5\n");
  EXPECT_EQ(set.tracks.at(0).frames.at(0).at(0).keypoints[0].score, 0.25);
  EXPECT_EQ(set.tracks.at(1).frames.at(0).at(0).keypoints[0].x_px, 30);
  const Pose2dSet both = ReadText("camera,frame,joint,x_px,y_px,score,x,confidence\na,0,nose,10,20,0.25,1,1\n");
  EXPECT_EQ(both.tracks.at(0).frames.at(0).at(0).keypoints[0].x_px, 10) << "our own names come first";
  EXPECT_EQ(both.tracks.at(0).frames.at(0).at(0).keypoints[0].score, 0.25);
}

TEST_F(Pose2dCsv, JointsComeFromTheFile) {
  const Pose2dSet set = ReadText(std::string(kHeader) +
                                 "left,3,0,tail,10.5,20,0.9\n"
                                 "left,3,0,nose,11,21,0.8\n"
                                 "right,7,2,nose,1,2,1\n"
                                 "right,7,5,tail,3,4,1\n");
  EXPECT_EQ(set.skeleton.name, "points");
  EXPECT_THAT(set.skeleton.joints, ElementsAre("tail", "nose"));
  EXPECT_THAT(set.skeleton.bones, IsEmpty());
  ASSERT_EQ(set.tracks.size(), 2u);
  EXPECT_EQ(set.tracks[0].camera, "left");
  EXPECT_EQ(set.tracks[0].frames.at(3)[0].keypoints[1].x_px, 11);
  EXPECT_EQ(set.tracks[0].frames.at(3)[0].keypoints[0].score, 0.9);
  ASSERT_EQ(set.tracks[1].frames.at(7).size(), 2u);  // persons 2 and 5 are the first and second detection
  EXPECT_EQ(set.tracks[1].frames.at(7)[0].keypoints[0].score, 0);
  EXPECT_EQ(set.tracks[1].frames.at(7)[1].keypoints[0].y_px, 4);
  EXPECT_THAT(set.skipped, IsEmpty());
}

TEST_F(Pose2dCsv, ColumnsInAnyOrderSomeLeftOut) {
  const Pose2dSet set = ReadText("\xEF\xBB\xBFy_px,x_px, joint ,note,frame,camera\r\n2,1,m1,hello,5,a\r\n\r\n4,3,m2,,5,a\r\n");
  ASSERT_EQ(set.tracks.size(), 1u);
  const auto& keypoints = set.tracks[0].frames.at(5).at(0).keypoints;
  EXPECT_EQ(keypoints[1].x_px, 3);
  EXPECT_EQ(keypoints[1].score, 1);
}

TEST_F(Pose2dCsv, NamesInQuotes) {
  const Pose2dSet set = ReadText(std::string(kHeader) + "\"left, \"\"A\"\"\",3,0,\"tail\",1,2,1\nb\"c,3,0,tail,1,2,1\n");
  EXPECT_EQ(set.tracks.at(0).camera, "left, \"A\"");
  EXPECT_EQ(set.tracks.at(1).camera, "b\"c");
  const Pose2dSet odd{geometry::PointsSkeleton({"\"a", " b"}), {{"\"cam\"", {{1, {{{{1, 2, 1}, {3, 4, 1}}}}}}}}};
  WritePose2dCsv(odd, folder_ / "out.csv");
  const Pose2dSet read = ReadPose2dCsv(folder_ / "out.csv");
  EXPECT_THAT(read.skeleton.joints, ElementsAre("\"a", " b"));
  EXPECT_EQ(read.tracks.at(0).camera, "\"cam\"");
}

TEST_F(Pose2dCsv, DecimalCommasAndSemicolonsAreNamed) {
  EXPECT_THAT(Message("camera;frame;joint;x_px;y_px\n"), AllOf(HasSubstr("line 1"), HasSubstr("';'")));
  EXPECT_THAT(Message(std::string(kHeader) + "a,1,0,m,\"1,5\",2,1\n"), HasSubstr("`1,5`, not a number; is its comma"));
  EXPECT_THAT(Message(std::string(kHeader) + "a,1,0,m,1,5,2,5,1\n"), HasSubstr("line 2: 9 columns, the header has 7; decimal"));
}

TEST_F(Pose2dCsv, FrameNumbersThatAreTooLargeAreCalledSo) {
  EXPECT_THAT(Message(std::string(kHeader) + "a,2147483648,0,m,1,2,1\n"), HasSubstr("`2147483648`, which is too large"));
  EXPECT_THAT(Message(std::string(kHeader) + "a,-1,0,m,1,2,1\n"), HasSubstr("counted from 0"));
  EXPECT_THAT(Message(std::string(kHeader) + "a,1,2147483648,m,1,2,1\n"),
              HasSubstr("`2147483648`, not a whole number from 0 to"));
  EXPECT_EQ(ReadText(std::string(kHeader) + "a,2147483647,0,m,1,2,1\n").tracks.at(0).frames.begin()->first, 2147483647);
}

TEST_F(Pose2dCsv, GivenSkeletonOrdersTheJoints) {
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("coco17");
  const Pose2dSet set = ReadText(std::string(kHeader) + "a,0,0,RAnkle,1,2,1\n", &skeleton);
  EXPECT_EQ(set.tracks[0].frames.at(0)[0].keypoints[16].x_px, 1);
  EXPECT_THAT(Message(std::string(kHeader) + "a,0,0,RAnkle,1,2,1\na,0,0,tail,1,2,1\na,0,0,Nose,1,2,1\n", &skeleton),
              AllOf(HasSubstr("line 3"), HasSubstr("tail"), HasSubstr("coco17")));
}

TEST_F(Pose2dCsv, RoundTripIsExact) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Rng rng(seed);
    Pose2dSet set{geometry::PointsSkeleton({"a", "b", "c d"}), {}};
    for (const char* camera : {"cam_1", "cam_0"}) {
      Pose2dTrack& track = set.tracks.emplace_back(Pose2dTrack{camera, {}});
      for (const int frame : {0, 9, 123456}) {
        for (int64_t p = 1 + rng.Index(3); p > 0; --p) {
          Person2d& person = track.frames[frame].emplace_back();
          for (int j = 0; j < 3; ++j) person.keypoints.push_back({rng.Normal() * 1e3, rng.Normal() * 1e-3, rng.Uniform()});
        }
      }
    }
    WritePose2dCsv(set, folder_ / "out.csv");
    const Pose2dSet read = ReadPose2dCsv(folder_ / "out.csv");
    EXPECT_EQ(read.skeleton.joints, set.skeleton.joints);
    ASSERT_EQ(read.tracks.size(), 2u);
    for (size_t c = 0; c < 2; ++c) {
      EXPECT_EQ(read.tracks[c].camera, set.tracks[c].camera);
      for (const auto& [frame, people] : set.tracks[c].frames) {
        ASSERT_EQ(read.tracks[c].frames.at(frame).size(), people.size());
        for (size_t p = 0; p < people.size(); ++p) {
          for (size_t j = 0; j < 3; ++j) {
            const Keypoint2d &a = people[p].keypoints[j], &b = read.tracks[c].frames.at(frame)[p].keypoints[j];
            EXPECT_TRUE(a.x_px == b.x_px && a.y_px == b.y_px && a.score == b.score);
          }
        }
      }
    }
  }
}

TEST_F(Pose2dCsv, NamesThatBreakTheTableAreRefused) {
  const Pose2dSet set{geometry::PointsSkeleton({"a,b"}), {}};
  EXPECT_THROW(WritePose2dCsv(set, folder_ / "out.csv"), ContractViolation);
}

TEST_F(Pose2dCsv, BadRowsAreLeftOutAndListed) {
  std::string text = kHeader;
  for (int f = 0; f < 20; ++f) text += "a," + std::to_string(f) + ",0,m,1,2,1\n";
  const Pose2dSet set = ReadText(text +
                                 "a,20,0,m,nan,2,1\n"    // line 22: one missing value costs one value
                                 "a,21,0,m,1,inf,1\n"    // 23: the same
                                 "a,-1,0,m,1,2,1\n"      // 24
                                 "a,22,x,m,1,2,1\n"      // 25
                                 "a,23,0,m,1\n"          // 26
                                 "a,24,0,m,,,\n"         // 27: not detected
                                 "a,25,0,m,1e999,2,1\n"  // 28
                                 "a,3,0,m,1,2,1\n"       // 29: twin of line 5
                                 ",3,0,m,1,2,1\n");      // 30
  EXPECT_THAT(set.skipped, ElementsAre(HasSubstr("line 24"), HasSubstr("line 25"), HasSubstr("line 26"), HasSubstr("line 28"),
                                       HasSubstr("line 30"), HasSubstr("lines 5 and 29")));
  EXPECT_EQ(set.tracks[0].frames.count(3), 0u);
  for (const int frame : {20, 21, 24}) EXPECT_EQ(set.tracks[0].frames.at(frame)[0].keypoints[0].score, 0) << frame;
  EXPECT_EQ(set.tracks[0].frames.size(), 22u);
}

TEST_F(Pose2dCsv, ColumnsAsOtherProgramsCallThem) {
  std::ofstream(folder_ / "other.csv") << "View,Frame,Bodypart,U,V,Likelihood\na,3,nose,1,2,0.5\n";
  const Pose2dSet set = ReadPose2dCsv(folder_ / "other.csv");
  EXPECT_THAT(set.skeleton.joints, ElementsAre("nose"));
  const Keypoint2d& key = set.tracks.at(0).frames.at(3).at(0).keypoints[0];
  EXPECT_EQ(key.y_px, 2);
  EXPECT_EQ(key.score, 0.5);
}

TEST_F(Pose2dCsv, TimesGiveFramesWhereNoColumnDoes) {
  std::ofstream(folder_ / "timed.csv") << "camera,time,joint,x,y\n"
                                          "a,0.1,p,1,1\na,0.1,q,2,2\na,0.2,p,3,3\na,0.3,p,4,4\na,0.6,p,5,5\n"
                                          "b,0.0,p,1,2\nb,0.1,p,1,3\nb,0.2,p,1,4\n";
  const Pose2dSet set = ReadPose2dCsv(folder_ / "timed.csv");
  EXPECT_NEAR(set.time_step, 0.1, 1e-9);
  EXPECT_EQ(set.tracks[0].frames.at(1)[0].keypoints[1].x_px, 2);
  EXPECT_EQ(set.tracks[0].frames.at(6)[0].keypoints[0].x_px, 5);
  EXPECT_EQ(set.tracks[1].frames.at(1)[0].keypoints[0].y_px, 3);
  EXPECT_THAT(Message("camera,time,joint,x,y\na,0,p,1,1\na,1,p,1,1\na,2,p,1,1\na,3.5,p,1,1\n"), HasSubstr("no multiple"));
}

/// A camera at half the rate, and one that has a single time, count the steps of the fastest.
TEST_F(Pose2dCsv, CamerasOfOneTableShareOneStep) {
  std::string text = "camera,time_ms,joint,x,y\n";
  for (int frame = 0; frame < 6; ++frame) text += "fast," + std::to_string(40 * frame) + ",p," + std::to_string(frame) + ",1\n";
  for (int frame = 0; frame < 6; frame += 2)
    text += "half," + std::to_string(40 * frame) + ",p," + std::to_string(frame) + ",1\n";
  std::ofstream(folder_ / "rates.csv") << text << "once,120,p,3,1\n";
  const Pose2dSet set = ReadPose2dCsv(folder_ / "rates.csv");
  EXPECT_NEAR(set.time_step, 40, 1e-9);
  ASSERT_EQ(set.tracks.size(), 3u);
  for (const Pose2dTrack& track : set.tracks) {
    for (const auto& [frame, people] : track.frames) EXPECT_EQ(people[0].keypoints[0].x_px, frame) << track.camera;
  }
  EXPECT_EQ(set.tracks[1].frames.size(), 3u);
  EXPECT_THAT(Message(text + "odd,0,p,0,1\nodd,60,p,1,1\nodd,120,p,2,1\n"), HasSubstr("camera odd: the step from 0 to 60"));
}

TEST_F(Pose2dCsv, HopelessFilesAreErrors) {
  EXPECT_THAT(Message(""), HasSubstr("empty"));
  EXPECT_THAT(Message(kHeader), HasSubstr("no point"));
  EXPECT_THAT(Message("camera,frame,joint,x_px\n"), HasSubstr("no column `y_px`"));
  EXPECT_THAT(Message("camera,frame,joint,x_px,y_px,frame\n"), HasSubstr("two columns"));
  EXPECT_THAT(Message(std::string(kHeader) + "a,b,c,d,e,f,g\n"), AllOf(HasSubstr("line 2"), HasSubstr("`frame` is `b`")));
  EXPECT_THAT(Message(std::string(kHeader) + "a,1,0,m,1,2,1\na,1,0,m,1,2,1\n"), HasSubstr("twice"));
  EXPECT_THROW(ReadPose2dCsv(folder_ / "none.csv"), IoError);
}

TEST_F(Pose2dCsv, MutationsNeverCrash) {
  std::string whole = kHeader;
  for (int f = 0; f < 6; ++f) whole += "cam_" + std::to_string(f % 2) + "," + std::to_string(f) + ",0,nose,10.25,20.5,0.75\n";
  Rng rng(11);
  for (int trial = 0; trial < 300; ++trial) {
    std::string mutated = whole;
    for (int k = 0; k < 4; ++k)
      mutated[static_cast<size_t>(rng.Index(static_cast<int64_t>(whole.size())))] = static_cast<char>(rng.Index(256));
    try {
      const Pose2dSet set = ReadText(mutated);
      for (const Pose2dTrack& track : set.tracks) {
        for (const auto& [frame, people] : track.frames) {
          EXPECT_GE(frame, 0);
          for (const Person2d& person : people) EXPECT_EQ(person.keypoints.size(), set.skeleton.joints.size());
        }
      }
    } catch (const FormatError&) {
    }
  }
}

}  // namespace
}  // namespace mvstudio::dataset
