#include "dataset/panoptic.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "core/check.h"
#include "core/files.h"
#include "dataset/json_internal.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using internal::Json;
using internal::JsonView;

constexpr char kPoseFolder[] = "hdPose3d_stage1_coco19";

Coco19Pose ReadJoints(const JsonView& joints) {
  if (joints.ArraySize() != 76)
    joints.Fail("must hold 76 numbers (x, y, z, c of 19 joints), holds " + std::to_string(joints.ArraySize()));
  Coco19Pose pose;
  for (size_t j = 0; j < 19; ++j) {
    const double x = joints[4 * j].Number(), y = joints[4 * j + 1].Number(), z = joints[4 * j + 2].Number();
    const double confidence = joints[4 * j + 3].Number();
    pose.valid[j] = confidence >= 0;
    if (!pose.valid[j]) continue;
    pose.confidence[j] = confidence;
    pose.x_in_world.col(static_cast<Eigen::Index>(j)) << x / 100.0, z / 100.0, -y / 100.0;
  }
  return pose;
}

std::string JointText(double value, const char* format) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return std::string(text) == "-0" ? "0" : text;
}

std::string JointsText(const Coco19Pose& pose) {
  std::string text;
  for (int j = 0; j < 19; ++j) {
    if (j) text += ", ";
    if (!pose.valid[j]) {
      text += "0, 0, 0, -1";
      continue;
    }
    const Eigen::Vector3d x = pose.x_in_world.col(j);
    MVS_CHECK(x.allFinite(), "joint " << j << " is marked valid and is not finite");
    text += JointText(100 * x[0], "%.10g") + ", " + JointText(-100 * x[2], "%.10g") + ", " + JointText(100 * x[1], "%.10g") +
            ", " + JointText(pose.confidence[j], "%.6g");
  }
  return text;
}

std::string FrameName(const std::string& camera, int frame) {
  char number[16];
  std::snprintf(number, sizeof(number), "_%08d", frame);
  return camera + number;
}

std::map<std::string, std::string> ReadAliases(const std::string& root) {
  std::map<std::string, std::string> aliases;
  const std::string path = root + "/dataset.json";
  if (!fs::exists(path)) return aliases;
  const Json json = internal::ParseJsonFile(path);
  const JsonView cameras = JsonView(path, json)["cameras"];
  for (size_t i = 0; i < cameras.ArraySize(); ++i) aliases[cameras[i]["alias"].Text()] = cameras[i]["name"].Text();
  return aliases;
}

}  // namespace

Body3dScene ReadBody3dSceneFile(const std::string& path) {
  const Json json = internal::ParseJsonFile(path);
  const JsonView file(path, json);
  Body3dScene scene;
  if (file.Has("univTime")) scene.univ_time_ms = file["univTime"].Number();
  if (file.Has("fpsType")) scene.fps_type = file["fpsType"].Text();
  const JsonView bodies = file["bodies"];
  for (size_t i = 0; i < bodies.ArraySize(); ++i) {
    const int id = bodies[i]["id"].Int();
    if (id < 0) continue;
    if (!bodies[i].Has("joints19") && (bodies[i].Has("joints15") || bodies[i].Has("joints26"))) {
      bodies[i].Fail("has another skeleton than joints19, which is the one that is read");
    }
    const Coco19Pose pose = ReadJoints(bodies[i]["joints19"]);
    if (!scene.people.emplace(id, pose).second) bodies[i]["id"].Fail(std::to_string(id) + " is there twice");
  }
  return scene;
}

std::map<int, Coco19Pose> ReadBody3dScene(const std::string& path) { return ReadBody3dSceneFile(path).people; }

void WriteBody3dScene(const std::map<int, Coco19Pose>& people, double univ_time_ms, const std::string& path) {
  std::string text = "{ \"version\": 0.7, \n\"univTime\" :" + JointText(univ_time_ms, "%0.3f") +
                     ",\n\"fpsType\" :\"hd_29_97\",\n\"bodies\" :\n[";
  bool first = true;
  for (const auto& [id, pose] : people) {
    MVS_CHECK(id >= 0, "person id " << id);
    text += std::string(first ? "\n" : ",\n") + "{ \"id\": " + std::to_string(id) + ",\n\"joints19\": [" + JointsText(pose) +
            "]\n}";
    first = false;
  }
  WriteFileAtomic(path, text + "\n] }");
}

std::string PanopticDataset::Resolve(const std::string& camera) const {
  if (rig.Find(camera) >= 0) return camera;
  const auto found = aliases.find(camera);
  return found == aliases.end() ? "" : found->second;
}

std::string PanopticDataset::ImagePath(const std::string& camera, int frame) const {
  const std::string stem = root + "/hdImgs/" + camera + "/" + FrameName(camera, frame);
  return !fs::exists(stem + ".jpg") && fs::exists(stem + ".png") ? stem + ".png" : stem + ".jpg";
}

std::string PanopticDataset::MaskPath(const std::string& camera, int frame) const {
  return root + "/masks/" + camera + "/" + FrameName(camera, frame) + ".png";
}

std::string FindPanopticCalibration(const std::string& root) {
  if (!fs::is_directory(root)) throw IoError(root, "no such folder");
  const std::vector<std::string> found = Glob(root + "/calibration_*.json");
  if (found.empty()) throw IoError(root, "holds no calibration_<sequence>.json: not a dataset in Panoptic layout");
  if (found.size() > 1) {
    throw FormatError(root, "",
                      "holds several calibrations (" + fs::path(found[0]).filename().string() + ", " +
                          fs::path(found[1]).filename().string() + "); keep one");
  }
  return found[0];
}

std::map<int, std::string> ListBody3dScenes(const std::string& root) {
  std::map<int, std::string> files;
  const std::string prefix = "body3DScene_";
  for (const std::string& path : Glob(root + "/" + kPoseFolder + "/" + prefix + "*.json")) {
    const std::string digits = fs::path(path).stem().string().substr(prefix.size());
    if (digits.size() != 8 || digits.find_first_not_of("0123456789") != std::string::npos) continue;
    files[std::stoi(digits)] = path;
  }
  return files;
}

PanopticDataset OpenPanopticDataset(const std::string& root) {
  PanopticDataset dataset;
  dataset.root = root;
  const std::string calibration = FindPanopticCalibration(root);
  const std::string stem = fs::path(calibration).stem().string();
  dataset.sequence = stem.substr(std::string("calibration_").size());
  dataset.rig = ReadPanopticCalibration(calibration);
  auto& cameras = dataset.rig.cameras;
  cameras.erase(std::remove_if(cameras.begin(), cameras.end(),
                               [&](const geometry::RigCamera& c) {
                                 const fs::path folder = fs::path(root) / "hdImgs" / c.camera.name;
                                 return !fs::is_directory(folder) || fs::is_empty(folder);
                               }),
                cameras.end());
  if (cameras.empty())
    throw FormatError(root, "hdImgs", "holds no pictures of any camera of " + fs::path(calibration).filename().string());
  dataset.aliases = ReadAliases(root);
  for (const auto& [frame, path] : ListBody3dScenes(root)) {
    dataset.frames.push_back(frame);
    dataset.poses[frame] = ReadBody3dScene(path);
  }
  if (dataset.frames.empty()) throw IoError(root + "/" + kPoseFolder, "holds no body3DScene_%08d.json");
  return dataset;
}

}  // namespace mvstudio::dataset
