#pragma once

#include <unistd.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <string>

#include "avatar/body/body_template.h"
#include "avatar/body/mesh_raster.h"
#include "core/disk/files.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::avatar {

/// A folder that goes away with the test.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::string& name)
      : path_((std::filesystem::temp_directory_path() / ("mvstudio_" + name + "_" + std::to_string(::getpid()))).string()) {
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// Camera on a circle of 3 m around the z axis, 1 m high, looking at (0, 0, 0.9); Brown lens.
inline geometry::RigCamera RingCamera(int index, int count, int size_px) {
  const double angle = 2 * 3.14159265358979 * index / count;
  const Eigen::Vector3d center(3 * std::sin(angle), -3 * std::cos(angle), 1.0),
      forward = (Eigen::Vector3d(0, 0, 0.9) - center).normalized();
  Eigen::Matrix3d rotation;  // rows: camera axes in world
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("00_0" + std::to_string(index), size_px, size_px, 1.15 * size_px);
  camera.camera.model = geometry::LensModel::kBrown5;
  camera.camera.params.conservativeResize(9);
  camera.camera.params.tail<5>() << -0.08, 0.02, 0.001, -0.0005, 0.003;
  camera.cam_from_world = {Eigen::Quaterniond(rotation), -(rotation * center)};
  return camera;
}

/// The mannequin with one arm at `angle` radians above its rest position, turned about z by a quarter of that.
inline body::BodyPose SwingPose(const body::BodyTemplate& body, double angle) {
  std::vector<Eigen::Quaterniond> local(body.bone_names.size(), Eigen::Quaterniond::Identity());
  for (size_t b = 0; b < body.bone_names.size(); ++b) {
    if (body.bone_names[b] == "l_upper_arm") local[b] = Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY());
    if (body.bone_names[b] == "r_thigh") local[b] = Eigen::AngleAxisd(0.4 * angle, Eigen::Vector3d::UnitY());
  }
  return body::PoseFromAngles(
      body, {Eigen::Quaterniond(Eigen::AngleAxisd(angle / 4, Eigen::Vector3d::UnitZ())), Eigen::Vector3d::Zero()}, local);
}

/// A dataset in Panoptic layout: the mannequin before a grey wall, part number and chart coordinates as its colour. Frame f has
/// the arm at 0.1 f radians.
inline void WriteMannequinDataset(const std::string& root, int cameras, int frames, int size_px) {
  const body::BodyTemplate body = body::MakeMannequin(1.75, 0.5);
  geometry::Rig rig;
  for (int c = 0; c < cameras; ++c) rig.cameras.push_back(RingCamera(c, cameras, size_px));
  MakeFolder(root);
  dataset::WritePanopticCalibration(rig, root + "/calibration_test.json", "test");
  for (int f = 0; f < frames; ++f) {
    const body::BodyPose pose = SwingPose(body, 0.1 * f);
    const Eigen::Matrix3Xf vertices = body::SkinVertices(body, pose);
    const std::string number = Format("%08d", f);
    for (const geometry::RigCamera& camera : rig.cameras) {
      const body::PartUvMap map = body::RasterizeBody(body, vertices, camera);
      Image image(size_px, size_px, 3, 90), mask(size_px, size_px, 1);
      for (size_t i = 0; i < map.part.size(); ++i) {
        if (map.part[i] == 0) continue;
        mask.pixels[i] = 255;
        image.pixels[3 * i] = static_cast<uint8_t>(10 * map.part[i]);
        image.pixels[3 * i + 1] = static_cast<uint8_t>(255 * map.u[i]);
        image.pixels[3 * i + 2] = static_cast<uint8_t>(255 * map.v[i]);
      }
      const std::string stem = camera.camera.name + "/" + camera.camera.name + "_" + number;
      dataset::WriteImage(image, root + "/hdImgs/" + stem + ".png");
      dataset::WriteImage(mask, root + "/masks/" + stem + ".png");
    }
    dataset::Coco19Pose joints;
    joints.x_in_world = body::PosedCoco19(body, pose);
    joints.valid.fill(true);
    joints.confidence.fill(1);
    dataset::WriteBody3dScene({{0, joints}}, 1000.0 * f / 30, root + "/hdPose3d_stage1_coco19/body3DScene_" + number + ".json");
  }
}

}  // namespace mvstudio::avatar
