#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "core/disk/files.h"
#include "core/format.h"
#include "core/image.h"
#include "core/units.h"
#include "dataset/exports/export.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/views/split.h"
#include "tests/support/run_cli.h"
#include "tests/support/temp_dir.h"

/// Small datasets in Panoptic layout, and the client that reads exports of them.
namespace mvstudio::exports::testing {

using mvstudio::testing::TempDir;

inline Eigen::Quaterniond LookAt(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d z = (to - from).normalized();
  Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();
  if (std::abs(z.dot(down)) > 0.99) down = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d x = down.cross(z).normalized();
  Eigen::Matrix3d cam_from_world;
  cam_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  return Eigen::Quaterniond(cam_from_world);
}

struct Setting {
  int cameras = 5;
  bool distorted = false;
  int width = 96, height = 72;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< where the people are
  std::vector<int> frames = {245, 246, 248};
  int people = 1;
  bool missing_joints = false;
  bool images = true, masks = true;
  bool odd_poses = false;  ///< a camera at the world's origin, half turns
};

inline std::string PanopticName(int i) { return Format("%02d_%02d", i / 100, i % 100); }

/// Cameras around `origin`, 3 m away, each with a lens of its own.
inline geometry::Rig MakeRig(const Setting& setting) {
  geometry::Rig rig;
  for (int i = 0; i < setting.cameras; ++i) {
    const double angle = 2 * kPi * i / setting.cameras + 0.3, scale = setting.width / 96.0;
    geometry::RigCamera camera;
    camera.camera = geometry::MakePinhole(PanopticName(i), setting.width, setting.height, (78 + 0.37 * i) * scale);
    camera.camera.params[1] *= 1.01;
    camera.camera.params[2] += 1.3 - 0.2 * i;
    camera.camera.params[3] -= 0.7 + 0.1 * (i % 7);
    if (setting.distorted) {
      camera.camera.model = geometry::LensModel::kBrown5;
      camera.camera.params.conservativeResize(9);
      camera.camera.params.tail(5) << -0.24 + 0.001 * i, 0.2, 1e-3, -7e-4, -0.06 + 0.002 * i;
    }
    const Eigen::Vector3d centre =
        setting.origin + Eigen::Vector3d(3 * std::cos(angle), 3 * std::sin(angle), 1.4 + 0.05 * (i % 5));
    camera.cam_from_world.rotation = LookAt(centre, setting.origin + Eigen::Vector3d(0, 0, 0.9));
    camera.cam_from_world.translation = -(camera.cam_from_world.rotation * centre);
    rig.cameras.push_back(camera);
  }
  if (setting.odd_poses) {
    // At the origin with no rotation at all; half turns about x and y, looking at people from above and from the side.
    rig.cameras[0].cam_from_world = geometry::Rigid3();
    rig.cameras[1].cam_from_world = {Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d(0, 1, 6)};
    rig.cameras[2].cam_from_world = {Eigen::Quaterniond(0, 0, 1, 0), Eigen::Vector3d(0, -1, 7)};
  }
  return rig;
}

/// A person of 1.75 m who turns and swings an arm as the frames go by.
inline dataset::Coco19Pose Person(const Eigen::Vector3d& at, int frame, bool missing) {
  const double joints[19][3] = {{0, 0, 1.45},       {0, -0.1, 1.6},  {0, 0, 0.95},        {0.18, 0, 1.42}, {0.34, 0, 1.2},
                                {0.48, 0, 1.0},     {0.1, 0, 0.93},  {0.14, 0, 0.5},      {0.16, 0, 0.1},  {-0.18, 0, 1.42},
                                {-0.34, 0, 1.2},    {-0.48, 0, 1.0}, {-0.1, 0, 0.93},     {-0.14, 0, 0.5}, {-0.16, 0, 0.1},
                                {0.03, -0.1, 1.64}, {0.07, 0, 1.62}, {-0.03, -0.1, 1.64}, {-0.07, 0, 1.62}};
  const Eigen::AngleAxisd turn(0.1 * (frame % 50), Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd swing(0.15 * (frame % 20), Eigen::Vector3d::UnitX());
  dataset::Coco19Pose pose;
  for (int j = 0; j < 19; ++j) {
    Eigen::Vector3d x(joints[j][0], joints[j][1], joints[j][2]);
    if (j == 4 || j == 5) {
      const Eigen::Vector3d shoulder(0.18, 0, 1.42);
      x = shoulder + swing * (x - shoulder);
    }
    pose.x_in_world.col(j) = at + turn * x;
    pose.valid[j] = !(missing && (j + frame) % 4 == 0);
    pose.confidence[j] = pose.valid[j] ? 0.5 + 0.02 * j : 0;
  }
  return pose;
}

/// A disc, where the person would be.
inline Image Disc(int width, int height, bool mask) {
  Image image(width, height, mask ? 1 : 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool inside = std::hypot(x - width / 2.0, y - height / 2.0) < height / 3.0;
      for (int c = 0; c < image.channels; ++c) {
        image.Pixel(x, y)[c] = static_cast<uint8_t>(mask ? 255 * inside : inside ? 200 : 60 + 20 * c + x / 2);
      }
    }
  }
  return image;
}

/// Writes the dataset and reads it back.
inline dataset::PanopticDataset MakeDataset(const std::string& root, const Setting& setting) {
  const geometry::Rig rig = MakeRig(setting);
  dataset::WritePanopticCalibration(rig, root + "/calibration_test.json", "test");
  const Image image = Disc(setting.width, setting.height, false), mask = Disc(setting.width, setting.height, true);
  for (const int frame : setting.frames) {
    std::map<int, dataset::Coco19Pose> people;
    for (int p = 0; p < setting.people; ++p) {
      people[3 * p] = Person(setting.origin + Eigen::Vector3d(0.7 * p, 0.4 * p, 0), frame, setting.missing_joints);
    }
    const std::string number = Format("%08d", frame);
    dataset::WriteBody3dScene(people, 40.0 * (frame - setting.frames.front()),
                              root + "/hdPose3d_stage1_coco19/body3DScene_" + number + ".json");
    for (const geometry::RigCamera& camera : rig.cameras) {
      const std::string& name = camera.camera.name;
      const std::string stem = "/" + name + "/" + name + "_" + number;
      MakeFolder(root + "/hdImgs/" + name);
      if (!setting.images) WriteFileAtomic(root + "/hdImgs/" + name + "/.keep", "");
      if (setting.images) dataset::WriteImage(image, root + "/hdImgs" + stem + ".jpg");
      if (setting.masks) dataset::WriteImage(mask, root + "/masks" + stem + ".png");
    }
  }
  return dataset::OpenPanopticDataset(root);
}

/// A python with numpy, or "" when there is none.
inline const std::string& Python() {
  static const std::string python = [] {
    for (const std::string candidate : {"python3", "/usr/bin/python3"}) {
      if (std::system((candidate + " -c 'import numpy, h5py' >/dev/null 2>&1").c_str()) == 0) return candidate;
    }
    return std::string();
  }();
  return python;
}

struct Reading {
  std::string format, folder, dataset;
};

/// What tests/clients/export_readers.py says of each export; an empty list when it crashes (its words go to `log`).
inline std::vector<nlohmann::json> ReadByClient(const std::vector<Reading>& readings, std::string* log) {
  const TempDir folder;
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  std::string line = Python() + " -B " +
                     mvstudio::testing::ShellQuote(std::string(source ? source : ".") + "/tests/clients/export_readers.py");
  for (const Reading& r : readings) {
    for (const std::string& word : {r.format, r.folder, r.dataset}) line += " " + mvstudio::testing::ShellQuote(word);
  }
  line += " >" + (folder / "out") + " 2>" + (folder / "err");
  const int status = std::system(line.c_str());
  *log = mvstudio::testing::Slurp(folder / "err");
  std::vector<nlohmann::json> results;
  std::istringstream lines(mvstudio::testing::Slurp(folder / "out"));
  for (std::string text; std::getline(lines, text);) results.push_back(nlohmann::json::parse(text, nullptr, false));
  if (status != 0 && log->empty()) *log = "exit " + std::to_string(status);
  return results;
}

}  // namespace mvstudio::exports::testing
