#include <gtest/gtest.h>

#include "core/format.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d_compare.h"
#include "tests/triangulate/support.h"
#include "triangulate/take/take.h"

/// A path-traced person with exact joints and 2D poses of 1 px noise, in files that this project did not write.
namespace mvstudio::triangulate {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 120;

std::vector<DetectedFrame> ReadFrames(const fs::path& root, const geometry::Rig& rig) {
  std::vector<DetectedFrame> frames(kFrames);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::string& name = rig.cameras[c].camera.name;
    const auto track = dataset::ReadOpenPoseFolder((root / "pose2d" / name).string(), name, geometry::SkeletonByName("body25"));
    for (const auto& [number, people] : track.frames) {
      DetectedFrame& frame = frames.at(static_cast<size_t>(number));
      frame.frame = number;
      frame.people.resize(rig.cameras.size());
      for (const dataset::Person2d& person : people) {
        DetectedPerson& detected = frame.people[c].emplace_back();
        for (const auto& key : person.keypoints) detected.push_back({{key.x_px, key.y_px}, key.score});
      }
    }
  }
  return frames;
}

TEST(PersonA, ErrorsAreSmallAndHonest) {
  const fs::path root = DataFolder() / "person_a";
  if (!fs::exists(root)) GTEST_SKIP() << "data set person_a is not there";
  const geometry::Rig rig = dataset::ReadPanopticCalibration((root / "calibration_person_a.json").string());
  const TakeResult take = TriangulateTake(rig, ReadFrames(root, rig), 25, {});

  dataset::Pose3d pose{"body25", {}};
  for (const TakePoint& entry : take.points) {
    dataset::JointRow row;
    row.frame = entry.frame, row.person = entry.person, row.joint = geometry::SkeletonByName("body25").joints[entry.joint_idx];
    row.status = entry.point.status;
    if (row.status == Status::kOk) row.x_in_world = entry.point.x_in_world, row.covariance = entry.point.covariance;
    pose.rows.push_back(row);
  }
  std::map<int, std::map<int, dataset::Coco19Pose>> truth;
  for (int f = 0; f < kFrames; ++f) {
    truth[f] = dataset::ReadBody3dScene((root / "hdPose3d_stage1_coco19" / Format("body3DScene_%08d.json", f)).string());
  }
  const auto comparison = dataset::ComparePose3d(dataset::ToCoco19Table(pose), dataset::ToTable(truth));
  EXPECT_EQ(comparison.num, kFrames * 19);
  EXPECT_LT(comparison.median_mm, 5.5);  // the information limit: the predicted sigmas say 5.1
  EXPECT_NEAR(take.sigma_px, 1, 0.04);
  // Four standard deviations of a binomial fraction of 2280.
  EXPECT_NEAR(comparison.coverage68, 0.68, 0.039);
  EXPECT_NEAR(comparison.coverage95, 0.95, 0.018);
  for (const CameraDiagnosis& camera : take.cameras) EXPECT_FALSE(camera.off || camera.scaled) << camera.message;
}

}  // namespace
}  // namespace mvstudio::triangulate
