#include <gmock/gmock.h>

#include <fstream>

#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/trackers/support.h"

/// Tables with a row a frame, as people write them with pandas from MediaPipe and others.
namespace mvstudio::dataset {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class WideCsv : public ::testing::Test {
 protected:
  TrackedPoints Read(const std::string& text) const {
    std::ofstream(folder_ / "a.csv") << text;
    return ReadTrackerFile(folder_ / "a.csv", "cam1");
  }
  testing::TempDir folder_;
};

TEST_F(WideCsv, JointsScoresAndFramesAreThoseOfTheColumns) {
  const TrackedPoints points = Read(
      "frame,person_score,nose_x,nose_y,nose_conf,left_hip_x,left_hip_y,left_hip_conf\n"
      "7,0.9,10.5,20,0.75,30,40,0.5\n9,0.9,11,21,1,,,\n");
  EXPECT_THAT(points.joints, ElementsAre("nose", "left_hip"));
  ASSERT_EQ(points.track.frames.size(), 2u);
  const Person2d& first = points.track.frames.at(7).at(0);
  EXPECT_EQ(first.keypoints[0].x_px, 10.5);
  EXPECT_EQ(first.keypoints[0].score, 0.75);
  EXPECT_EQ(first.keypoints[1].y_px, 40);
  EXPECT_EQ(points.track.frames.at(9).at(0).keypoints[1].score, 0) << "not detected";
}

TEST_F(WideCsv, RowsCountFrames) {
  const TrackedPoints points = Read("nose.x,nose.y,hip.x,hip.y\n1,2,3,4\n5,6,7,8\n");
  EXPECT_EQ(points.track.frames.at(1).at(0).keypoints[1].x_px, 7);
  EXPECT_EQ(points.track.frames.at(1).at(0).keypoints[1].score, 1);
}

TEST_F(WideCsv, DepthIsNoThirdCoordinateButPointsInSpaceAreRefused) {
  const TrackedPoints points = Read("frame,nose_x,nose_y,nose_z,nose_visibility\n0,10,20,-0.3,0.8\n");
  EXPECT_EQ(points.track.frames.at(0).at(0).keypoints[0].score, 0.8);
  const auto message = [&](const std::string& text) { return testing::MessageOf<FormatError>([&] { Read(text); }); };
  EXPECT_THAT(message("frame,nose_x,nose_y,nose_z\n0,10,20,30\n"), HasSubstr("3D points"));
  EXPECT_THAT(message("frame,nose_x,nose_y\n0,1k,2\n"), HasSubstr("`1k` is not a number"));
}

TEST_F(WideCsv, TablesOfAllCamerasAreNone) {
  std::ofstream(folder_ / "b.csv") << "camera,frame,person,joint,x_px,y_px,score\nc1,0,0,nose,1,2,1\n";
  EXPECT_EQ(DetectTracker(folder_ / "b.csv"), TrackerKind::kNone);
}

}  // namespace
}  // namespace mvstudio::dataset
