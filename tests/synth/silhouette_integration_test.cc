#include <cstdlib>
#include <filesystem>

#include "avatar/body/mesh_raster.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/panoptic.h"
#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

std::string DataFolder() {
  if (const char* data = std::getenv("MVSTUDIO_DATA")) return data;
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  return std::string(source ? source : ".") + "/../shared/data";
}

/// The mannequin, put onto another person's joints, fills that person's exact masks: what an avatar is initialised from.
TEST(Silhouette, MannequinOnAnotherPersonsJointsCoversTheMasks) {
  const std::string folder = DataFolder() + "/person_a";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "data set person_a is not in " << DataFolder();
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(folder);
  const body::BodyTemplate body = body::MakeMannequin();
  int64_t both = 0, either = 0;
  for (size_t k = 0; k < data.frames.size(); k += std::max<size_t>(1, data.frames.size() / 6)) {
    const int frame = data.frames[k];
    const dataset::Coco19Pose& joints = data.poses.at(frame).begin()->second;
    body::BodyPose pose;
    ASSERT_TRUE(body::PoseFromJoints(body, joints.x_in_world, joints.valid, &pose)) << "frame " << frame;
    const Eigen::Matrix3Xf vertices = body::SkinVertices(body, pose);
    for (size_t c = 0; c < data.rig.cameras.size(); c += 3) {
      const Image mask = dataset::ReadImage(data.MaskPath(data.rig.cameras[c].camera.name, frame), true);
      const body::PartUvMap map = body::RasterizeBody(body, vertices, data.rig.cameras[c]);
      ASSERT_EQ(mask.pixels.size(), map.part.size());
      for (size_t i = 0; i < mask.pixels.size(); ++i) {
        both += mask.pixels[i] > 127 && map.part[i] > 0;
        either += mask.pixels[i] > 127 || map.part[i] > 0;
      }
    }
  }
  EXPECT_GT(static_cast<double>(both) / either, 0.80);
}

}  // namespace
}  // namespace mvstudio::synth
