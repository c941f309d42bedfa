#include "dataset/exports/export.h"
#include "dataset/pose/markers.h"
#include "tests/exports/fixture.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// What is exported as markers is read back as the same joints.
namespace mvstudio::exports::testing {
namespace {

TEST(Markers, C3dRoundTripsThroughOurReader) {
  const TempDir folder;
  Setting setting;
  setting.missing_joints = true;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", setting);
  ExportDataset(dataset, "c3d", folder / "out", {});
  const dataset::MarkerFile back = dataset::ReadMarkers(folder / "out/test_person0.c3d");
  EXPECT_EQ(back.unit, "mm");
  EXPECT_FALSE(back.y_up);
  EXPECT_EQ(back.pose.rows.size(), 4u * 19);
  size_t seen = 0;
  for (const dataset::JointRow& row : back.pose.rows) {
    const auto pose = dataset.poses.find(row.frame);
    const int j = geometry::Coco19().Find(row.joint);
    ASSERT_GE(j, 0) << row.joint;
    const bool valid = pose != dataset.poses.end() && pose->second.at(0).valid[j];
    ASSERT_EQ(row.status == Status::kOk, valid);
    if (!valid) continue;
    EXPECT_LT((row.x_in_world - pose->second.at(0).x_in_world.col(j)).norm(), 1e-6);  // single precision
    ++seen;
  }
  EXPECT_GT(seen, 30u);
}

TEST(Markers, ADatasetsJointsComeBackFromTrc) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportDataset(dataset, "trc", folder / "out", {});
  const dataset::Pose3d pose = dataset::ReadPoints3d(folder / "out/test_person0.trc");
  EXPECT_TRUE(dataset::JointsBeyondCoco19(pose).empty());
  const auto poses = ToCoco19(pose);
  const dataset::Coco19Pose &a = poses.begin()->second.at(0), &b = dataset.poses.at(poses.begin()->first).at(0);
  EXPECT_EQ(a.valid, b.valid);
  EXPECT_LT((a.x_in_world - b.x_in_world).norm(), 1e-12);
}

}  // namespace
}  // namespace mvstudio::exports::testing
