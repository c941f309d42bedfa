#include "dataset/panoptic/panoptic.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "core/disk/paths.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/json/json_file.h"
#include "dataset/panoptic/sequence.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using internal::Json;
using internal::JsonView;

constexpr char kPoseFolder[] = "hdPose3d_stage1_coco19";

constexpr char kIsPack[] = "is a pack; this command reads the dataset that the pack was made from";

std::string FrameName(const std::string& camera, int frame) { return camera + Format("_%08d", frame); }

bool IsPackFile(const std::string& path) {
  std::error_code none;
  std::string head(8, '\0');
  std::ifstream file(fs::is_regular_file(path, none) ? path : "", std::ios::binary);
  return file.read(head.data(), 8) && head == "\x89HDF\r\n\x1a\n";
}

/// Of a folder without a calibration file: what it is instead, where that can be told.
std::string WhyNoDataset(const std::string& root) {
  if (!FilesNamed(root, "shard-", ".h5").empty()) return kIsPack;
  std::error_code none;
  if (!fs::exists(root + "/mvstudio.toml", none))
    return "holds no calibration_<sequence>.json: not a dataset in Panoptic layout";
  std::vector<std::string> found;
  const std::string folder = root + "/dataset";
  for (const std::string& name : fs::is_directory(folder, none) ? NamesIn(folder) : std::vector<std::string>{}) {
    const std::string path = folder + "/" + name;
    if (fs::is_directory(path, none) && !FilesNamed(path, "calibration_", ".json").empty()) found.push_back(path);
  }
  return "is a session, not a dataset; " + (found.empty()
                                                ? "mvstudio dataset build option 'session' " + root + " makes one of a take"
                                                : "its datasets: " + Join(found, ", "));
}

}  // namespace

std::map<std::string, std::string> ReadPanopticAliases(const std::string& root) {
  std::map<std::string, std::string> aliases;
  const std::string path = root + "/dataset.json";
  if (!fs::exists(path)) return aliases;
  const Json json = internal::ParseJsonFile(path);
  const JsonView cameras = JsonView(path, json)["cameras"];
  for (size_t i = 0; i < cameras.ArraySize(); ++i) aliases[cameras[i]["alias"].Text()] = cameras[i]["name"].Text();
  return aliases;
}

Body3dScene ReadBody3dSceneFile(const std::string& path) {
  const PanopticScene file = ReadPanopticScene(path);
  Body3dScene scene;
  scene.univ_time_ms = file.univ_time_ms.value_or(-1);
  scene.fps_type = file.fps_type.value_or("");
  scene.people = ToCoco19(file, path);
  return scene;
}

std::map<int, Coco19Pose> ReadBody3dScene(const std::string& path) { return ReadBody3dSceneFile(path).people; }

void WriteBody3dScene(const std::map<int, Coco19Pose>& people, double univ_time_ms, const std::string& path) {
  WritePanopticScene(ToPanopticScene(people, univ_time_ms), path);
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
  if (IsPackFile(root)) throw IoError(root, kIsPack);
  RequireFolder(root, "; a dataset is a folder in Panoptic's layout");
  const std::vector<std::string> found = FilesNamed(root, "calibration_", ".json");
  if (found.empty()) throw IoError(root, WhyNoDataset(root));
  if (found.size() > 1) {
    throw FormatError(root, "",
                      "holds several calibrations (" + fs::path(found[0]).filename().string() + ", " +
                          fs::path(found[1]).filename().string() + "); keep one");
  }
  return found[0];
}

std::string NotUnpacked(const std::string& root) {
  const std::vector<std::string> archives = FilesNamed(root, "", ".tar");
  if (archives.empty()) return "";
  const std::string first = fs::path(archives[0]).filename().string();
  return "; " + first + (archives.size() > 1 ? " and " + std::to_string(archives.size() - 1) + " more are" : " is") +
         " not unpacked: `tar -xf " + first + "` there";
}

std::map<int, std::string> ListBody3dScenes(const std::string& root) {
  std::map<int, std::string> files;
  const std::string prefix = "body3DScene_", folder = root + "/" + kPoseFolder;
  std::vector<std::string> found = FilesNamed(folder, prefix, ".json");
  if (found.empty()) found = FilesNamed(folder + "/hd", prefix, ".json");  // as CMU's first archives unpack
  for (const std::string& path : found) {
    const std::string digits = fs::path(path).stem().string().substr(prefix.size());
    if (digits.size() != 8 || digits.find_first_not_of("0123456789") != std::string::npos) continue;
    files[std::stoi(digits)] = path;
  }
  return files;
}

void ReadJoints(PanopticDataset* dataset) {
  for (const auto& [frame, path] : ListBody3dScenes(dataset->root)) {
    dataset->frames.push_back(frame);
    dataset->poses[frame] = ReadBody3dScene(path);
  }
  if (dataset->frames.empty())
    throw IoError(dataset->root + "/" + kPoseFolder, "holds no body3DScene_%08d.json" + NotUnpacked(dataset->root));
  dataset->own = ReadOwnJoints(dataset->root);
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
    throw FormatError(root, "hdImgs", "holds no images of any camera of " + fs::path(calibration).filename().string());
  dataset.aliases = ReadPanopticAliases(root);
  ReadJoints(&dataset);
  return dataset;
}

}  // namespace mvstudio::dataset
