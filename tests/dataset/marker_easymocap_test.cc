#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/pose/markers.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

/// Joint j of person `id` at (j, id, 0.5); joint 3 was not seen.
std::string Person(int id, int count) {
  std::string points;
  for (int j = 0; j < count; ++j)
    points += (j ? ",[" : "[") + std::to_string(j) + "," + std::to_string(id) + ",0.5," + (j == 3 ? "0.0" : "0.9") + "]";
  return "{\"id\":" + std::to_string(id) + ",\"keypoints3d\":[" + points + "]}";
}

class EasyMocapMarkers : public ::testing::Test {
 protected:
  void Put(const std::string& name, const std::string& text) const {
    MakeFolder(folder_ / "out/keypoints3d");
    std::ofstream(folder_ / ("out/keypoints3d/" + name)) << text;
  }
  std::string Refused(const std::string& text) const {
    Put("000000.json", text);
    return MessageOf<FormatError>([&] { ReadMarkers(folder_ / "out/keypoints3d", "m"); });
  }
  TempDir folder_;
};

TEST_F(EasyMocapMarkers, PeopleOfAFolderByTheirIds) {
  Put("000000.json", "[" + Person(0, 25) + "," + Person(7, 25) + "]");
  Put("000012.json", "[]");
  Put("000013.json", "[" + Person(7, 25) + "]");
  EXPECT_EQ(PointsFileAt(folder_ / "out"), folder_ / "out/keypoints3d");
  EXPECT_TRUE(IsPointsFile(folder_ / "out/keypoints3d"));
  MarkerFile file;
  const Pose3d pose = ReadPoints3d(folder_ / "out", "cm", "", &file);
  EXPECT_EQ(pose.skeleton, "body25");
  ASSERT_EQ(pose.rows.size(), 75u);
  EXPECT_EQ(pose.rows[25 + 2].person, 7);
  EXPECT_EQ(pose.rows[25 + 2].joint, "RShoulder");
  EXPECT_EQ(pose.rows[25 + 2].x_in_world, Eigen::Vector3d(2, 7, 0.5) * 0.01);
  EXPECT_EQ(pose.rows[25 + 3].status, Status::kTooFewViews);
  EXPECT_EQ(pose.rows[50].frame, 13);
  EXPECT_FALSE(file.y_up);
}

TEST_F(EasyMocapMarkers, HandsAreNamedAndTheFaceIsLeftOut) {
  Put("000000.json", "[" + Person(0, 137) + "]");
  const MarkerFile file = ReadMarkers(folder_ / "out/keypoints3d", "m");
  EXPECT_EQ(file.pose.rows.size(), 67u);
  EXPECT_THAT(file.notes.back(), HasSubstr("face"));
}

TEST_F(EasyMocapMarkers, WhatIsNotKnownIsRefused) {
  EXPECT_THAT(Refused("[" + Person(0, 24) + "]"), HasSubstr("[0].keypoints3d: 24 points"));
  EXPECT_THAT(Refused("[" + Person(0, 25) + "," + Person(1, 17) + "]"), HasSubstr("17 points, others have 25"));
  EXPECT_THAT(Refused("{}"), HasSubstr("a list of people"));
  EXPECT_THAT(Refused("[{\"keypoints3d\":[]}]"), HasSubstr("`id`"));
  EXPECT_THAT(Refused("[]"), HasSubstr("holds no person"));
  Put("000000.json", "[" + Person(0, 25) + "]");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMarkers(folder_ / "out/keypoints3d"); }), HasSubstr("option 'marker-unit'"));
  Put("0.json", "[]");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMarkers(folder_ / "out/keypoints3d", "m"); }), HasSubstr("same frame number"));
}

}  // namespace
}  // namespace mvstudio::dataset
