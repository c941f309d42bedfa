#include "stages/people/pose_truth.h"

#include <map>

#include "core/error.h"
#include "core/format.h"
#include "dataset/panoptic/panoptic.h"
#include "geometry/skeleton/skeleton.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Where joint k of a frame is: not in one plane.
Eigen::Vector3d Place(int frame, int k) { return {0.1 * k, 0.01 * k * k, 0.3 * frame + 0.002 * k * k * k}; }

/// Two frames of a person with coco19's joints, moved by `offset_m`.
dataset::Pose3d PoseAt(const Eigen::Vector3d& offset_m) {
  dataset::Pose3d pose{"coco19", {}};
  for (const int frame : {7, 8}) {
    for (int k = 0; k < 19; ++k) {
      dataset::JointRow row;
      row.frame = frame, row.joint = geometry::Coco19().joints[k], row.status = Status::kOk;
      row.x_in_world = Place(frame, k) + offset_m;
      pose.rows.push_back(row);
    }
  }
  return pose;
}

TEST(PoseTruth, DistancesToATableAreThoseOfTheOffset) {
  const TempDir folder;
  dataset::WritePose3d(PoseAt({0, 0, 0}), folder / "truth");
  const dataset::Pose3d pose = PoseAt({0.003, 0, -0.004});
  for (const std::string& truth : {folder / "truth", folder / "truth/points.csv"}) {
    const dataset::Pose3dComparison comparison = CompareWithTruth(pose, truth, {false}).comparison;
    EXPECT_EQ(comparison.num, 38);
    for (const double mm : {comparison.median_mm, comparison.mean_mm, comparison.p95_mm, comparison.max_mm})
      EXPECT_NEAR(mm, 5, 1e-9);
    EXPECT_FALSE(comparison.aligned);
  }
  const dataset::Pose3dComparison aligned = CompareWithTruth(pose, folder / "truth", {true}).comparison;
  EXPECT_TRUE(aligned.aligned);
  EXPECT_NEAR(aligned.max_mm, 0, 1e-6);
}

TEST(PoseTruth, AFreeMoCapRecordingIsTruthInItsUnit) {
  const TempDir folder;
  std::string table = "timestamp,timestamp_by_camera,body_nose_x,body_nose_y,body_nose_z\n";
  for (int frame = 0; frame < 9; ++frame) {
    const Eigen::Vector3d mm = 1000 * Place(frame, 1);  // coco19's second joint is the nose
    table += Format(",{},%.9g,%.9g,%.9g\n", mm.x(), mm.y(), mm.z());
  }
  Put(folder / "take/take_by_trajectory.csv", table);
  const TruthComparison found = CompareWithTruth(PoseAt({0.003, 0, -0.004}), folder / "take", {false, "mm"});
  EXPECT_EQ(found.comparison.num, 2);
  EXPECT_NEAR(found.comparison.max_mm, 5, 1e-5);
  EXPECT_EQ(found.unit + found.up, "mmz");
  EXPECT_THAT(found.notes, ::testing::Contains(HasSubstr("states no axis")));
  EXPECT_THROW(CompareWithTruth(PoseAt({0, 0, 0}), folder / "take", {false}), FormatError);
}

TEST(PoseTruth, PanopticsScenesAreTruthToo) {
  const TempDir folder;
  for (const int frame : {7, 8}) {
    std::map<int, dataset::Coco19Pose> people;
    for (int k = 0; k < 19; ++k) {
      people[0].x_in_world.col(k) = Place(frame, k);
      people[0].valid[k] = true, people[0].confidence[k] = 1;
    }
    dataset::WriteBody3dScene(people, -1, folder / ("body3DScene_0000000" + std::to_string(frame) + ".json"));
  }
  const dataset::Pose3dComparison comparison = CompareWithTruth(PoseAt({0, 0.002, 0}), folder.path(), {false}).comparison;
  EXPECT_EQ(comparison.num, 38);
  EXPECT_NEAR(comparison.median_mm, 2, 1e-9);
  Put(folder / "body3DScene_x.json", "{}");
  EXPECT_THAT(MessageOf<FormatError>([&] {
                CompareWithTruth(PoseAt({0, 0, 0}), folder.path(), {false});
              }),
              HasSubstr("body3DScene_x.json"));
}

TEST(PoseTruth, WhatIsNoTruthIsNamed) {
  const TempDir folder;
  for (const std::string& truth : {folder.path(), folder / "none"}) {
    const std::string message = MessageOf<IoError>([&] { CompareWithTruth(PoseAt({0, 0, 0}), truth, {false}); });
    EXPECT_THAT(message, HasSubstr(truth));
    EXPECT_THAT(message, HasSubstr("option 'truth'"));
  }
}

TEST(PoseTruth, CoverageIsToldOnlyWhereThereAreCovariances) {
  dataset::Pose3dComparison comparison;
  comparison.num = 4, comparison.median_mm = 1.5, comparison.coverage68 = 0.5;
  const nlohmann::ordered_json without = ComparisonToJson({comparison});
  EXPECT_EQ(without["median_mm"], 1.5);
  EXPECT_EQ(without["num"], 4);
  EXPECT_FALSE(without.contains("coverage68"));
  comparison.num_covariance = 4;
  EXPECT_EQ(ComparisonToJson({comparison})["coverage68"], 0.5);
}

}  // namespace
}  // namespace mvstudio::stages
