#include "calib/rig/numbering.h"

#include <gtest/gtest.h>

#include "calib/lens/resection.h"
#include "tests/calib/synthetic.h"

namespace mvstudio::calib {
namespace {

/// Faults of a scene whose boards `renumber` (camera, corner -> corner, or -1) calls otherwise.
template <class Renumber>
std::vector<NumberingFault> Faults(int cameras, double noise_px, const Renumber& renumber) {
  testing::SceneOptions options;
  options.num_cameras = cameras;
  options.noise_px = noise_px;
  testing::Scene scene = testing::MakeScene(options);
  std::vector<View> views;
  std::vector<geometry::Rigid3> poses;
  for (Detection detection : scene.detections) {
    Detection renumbered = detection;
    renumbered.corner_ids.clear();
    std::vector<int> kept;
    for (int i = 0; i < detection.num_corners(); ++i) {
      const int id = renumber(detection.camera_idx, detection.corner_ids[static_cast<size_t>(i)]);
      if (id >= 0) renumbered.corner_ids.push_back(id), kept.push_back(i);
    }
    renumbered.points_px = detection.points_px(Eigen::all, kept).eval();
    views.push_back(MakeView({scene.board}, renumbered, scene.truth.frames));
    const Resection pose = ResectPlane(scene.truth.cameras[static_cast<size_t>(detection.camera_idx)], views.back());
    poses.push_back(pose.cam_from_board);
  }
  return FindNumberingFaults(views, poses, geometry::CameraNames(scene.truth.cameras));
}

TEST(Numbering, ACameraThatCountsFromTheOtherEndIsNamed) {
  const auto faults = Faults(4, 0.3, [](int camera, int id) { return camera == 2 ? 53 - id : id; });
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].cameras, std::vector<std::string>{"cam2"});
  EXPECT_EQ(faults[0].what, "turned by half a turn");
  EXPECT_LT(4 * faults[0].mended_spread, faults[0].spread);
}

TEST(Numbering, OfTwoCamerasBothAreNamed) {
  const auto faults = Faults(2, 0.3, [](int camera, int id) { return camera == 1 ? 53 - id : id; });
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].cameras, (std::vector<std::string>{"cam0", "cam1"}));
}

TEST(Numbering, AColumnLessIsNamed) {
  const auto faults = Faults(4, 0.1, [](int camera, int id) { return camera != 1 ? id : id % 9 < 8 ? id + 1 : -1; });
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].cameras, std::vector<std::string>{"cam1"});
  EXPECT_EQ(faults[0].what, "shifted by a column");
}

TEST(Numbering, CamerasThatAgreeHaveNoFault) {
  for (const double noise : {0.0, 0.3, 2.0}) EXPECT_TRUE(Faults(3, noise, [](int, int id) { return id; }).empty()) << noise;
  EXPECT_TRUE(Faults(3, 0.1, [](int, int id) { return 53 - id; }).empty()) << "all alike is no fault";
  EXPECT_TRUE(FindNumberingFaults({}, {}, {"a"}).empty());
}

}  // namespace
}  // namespace mvstudio::calib
