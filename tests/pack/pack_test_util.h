#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/disk/files.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "dataset/pack/build.h"
#include "dataset/pack/pack.h"
#include "dataset/panoptic/panoptic.h"
#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {

/// Cameras 3 m from the origin, at the height of a chest, looking at the person; the first with a distorted lens.
inline geometry::Rig StudioRig(int cameras, int width_px, int height_px) {
  geometry::Rig rig;
  for (int i = 0; i < cameras; ++i) {
    geometry::RigCamera c;
    const std::string name = Format("00_%02d", i);
    c.camera = geometry::MakePinhole(name, width_px, height_px, 1.1 * height_px);
    if (i == 0) {
      c.camera.model = geometry::LensModel::kBrown5;
      c.camera.params.conservativeResize(9);
      c.camera.params.tail(5) << -0.1, 0.02, 1e-3, -5e-4, 1e-3;
    }
    const double angle = 0.7 * i;
    Eigen::Matrix3d r;  // rows: x right, y down, z forward, in world
    r << std::cos(angle), std::sin(angle), 0, 0, 0, -1, -std::sin(angle), std::cos(angle), 0;
    c.cam_from_world.rotation = Eigen::Quaterniond(r);
    c.cam_from_world.translation = -(r * Eigen::Vector3d(3 * std::sin(angle), -3 * std::cos(angle), 0.9));
    rig.cameras.push_back(c);
  }
  return rig;
}

/// A dataset with smooth images, masks and one or two standing people; frames from 5.
inline void WriteStudio(const std::string& root, int cameras, int frames, int people = 1, int width_px = 96,
                        int height_px = 72) {
  const geometry::Rig rig = StudioRig(cameras, width_px, height_px);
  WritePanopticCalibration(rig, root + "/calibration_studio.json", "test");
  PanopticDataset names;
  names.root = root;
  for (int frame = 5; frame < 5 + frames; ++frame) {
    std::map<int, Coco19Pose> poses;
    for (int person = 0; person < people; ++person) poses[person] = StandingPerson(0.02 * frame + 0.9 * person);
    poses[0].valid[16] = false;
    poses[0].x_in_world.col(16).setZero();
    poses[0].confidence[16] = 0;
    WriteBody3dScene(poses, 40.0 * frame, root + "/hdPose3d_stage1_coco19" + Format("/body3DScene_%08d.json", frame));
    for (int c = 0; c < cameras; ++c) {
      const std::string& camera = rig.cameras[c].camera.name;
      const std::string stem =
          root + "/hdImgs/" + camera + "/" + std::filesystem::path(names.MaskPath(camera, frame)).stem().string();
      WriteImage(SmoothImage(width_px, height_px, 0.3 * frame + c), stem + ".png");
      Image mask(width_px, height_px, 1);
      for (int y = height_px / 5; y < height_px; ++y) {
        for (int x = width_px / 3; x < width_px / 2 + frame; ++x) *mask.Pixel(x, y) = 255;
      }
      WriteImage(mask, names.MaskPath(camera, frame));
    }
  }
}

/// Name -> content of every file of a folder, hidden ones too.
inline std::map<std::string, std::string> FolderContent(const std::string& folder) {
  std::map<std::string, std::string> content;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().filename() == ".mvstudio.json") continue;
    content[entry.path().filename().string()] = ReadFile(entry.path().string());
  }
  return content;
}

inline PackOptions SmallPack() {
  PackOptions options;
  options.crop_px = 32;
  options.shard_samples = 6;
  return options;
}

/// All that a reader can get out of a pack, for comparisons.
inline std::string EverythingOf(const std::string& path, const PackOpenOptions& options) {
  const Pack pack = OpenPack(path, options);
  std::string all;
  const auto add = [&all](const void* data, size_t bytes) { all.append(static_cast<const char*>(data), bytes); };
  for (size_t i = 0; i < pack.samples().size(); ++i) {
    const PackSample& s = pack.samples()[i];
    const Image image = pack.ReadImage(i), mask = pack.ReadMask(i);
    add(image.pixels.data(), image.pixels.size());
    add(mask.pixels.data(), mask.pixels.size());
    add(s.joints_px.data(), sizeof(double) * 38);
    add(s.pose.x_in_world.data(), sizeof(double) * 57);
    add(s.pose.confidence.data(), sizeof(double) * 19);
    add(s.view.camera.params.data(), sizeof(double) * s.view.camera.params.size());
    add(s.view.cam_from_world.translation.data(), sizeof(double) * 3);
    add(s.view.cam_from_world.rotation.coeffs().data(), sizeof(double) * 4);
    for (int j = 0; j < 19; ++j) all += std::to_string(s.in_view[j]) + std::to_string(s.pose.valid[j]);
    all += " " + std::to_string(s.camera_idx) + " " + std::to_string(s.frame) + " " + std::to_string(s.person) + " " +
           std::string(ToString(s.part)) + std::to_string(s.univ_time_ms);
  }
  return all + pack.info().plan_json + pack.info().image_codec;
}

}  // namespace mvstudio::dataset
