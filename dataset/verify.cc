#include "dataset/verify.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <set>

#include "core/error.h"
#include "core/files.h"
#include "core/parallel.h"
#include "dataset/panoptic_internal.h"
#include "dataset/verify_internal.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using internal::Findings;
using internal::Json;
using internal::JsonView;
using internal::NumberText;

int Count(const std::vector<Finding>& findings, Finding::Severity severity) {
  return static_cast<int>(
      std::count_if(findings.begin(), findings.end(), [&](const Finding& f) { return f.severity == severity; }));
}

/// The part of a FormatError's message after the path.
std::string WithoutPath(const FormatError& error) {
  const std::string text = error.what();
  return text.compare(0, error.path().size() + 2, error.path() + ": ") == 0 ? text.substr(error.path().size() + 2) : text;
}

void VerifyCamera(const JsonView& json, const std::string& path, std::set<std::string>* names, geometry::Rig* rig,
                  Findings* findings) {
  double drift = 0;
  const geometry::RigCamera camera = internal::ReadPanopticCamera(json, &drift);
  const std::string& name = camera.camera.name;
  if (drift > 1e-6)
    findings->Warning("DAT-CALIB", path, json.where() + ".R: is " + NumberText(drift) + " from the nearest rotation");
  int panel = 0, node = 0;
  if (!ParsePanopticName(name, &panel, &node)) {
    findings->Error("DAT-NAME", path, json.where() + ".name: '" + name + "' is not of the form 00_00");
  } else {
    if (!json.Has("panel") || !json.Has("node") || json["panel"].Int() != panel || json["node"].Int() != node) {
      findings->Warning("DAT-NAME", path, json.where() + ": panel and node do not agree with the name '" + name + "'");
    }
  }
  if (!json.Has("type")) findings->Warning("DAT-CALIB", path, json.where() + ".type: is missing");
  if (!names->insert(name).second) {
    findings->Error("DAT-NAME", path, json.where() + ".name: '" + name + "' is there twice");
    return;
  }
  rig->cameras.push_back(camera);
}

/// Lengths between joints that every adult and child has, metres.
bool PlausiblePerson(const Coco19Pose& pose, double* length_m) {
  if (!pose.valid[0] || !pose.valid[2]) return true;
  *length_m = (pose.x_in_world.col(0) - pose.x_in_world.col(2)).norm();
  return *length_m > 0.15 && *length_m < 1.0;
}

void CheckPlausible(const Body3dScene& scene, const std::string& path, int* implausible, Findings* findings) {
  for (const auto& [id, pose] : scene.people) {
    double length_m = 0;
    if (PlausiblePerson(pose, &length_m)) continue;
    if (++*implausible == 1) {
      findings->Warning("DAT-UNITS", path,
                        "person " + std::to_string(id) + ": neck and body centre are " + NumberText(100 * length_m) +
                            " cm apart; Panoptic files are in centimetres");
    }
  }
}

void CheckOrder(const std::map<int, Body3dScene>& scenes, const std::string& folder, Findings* findings) {
  const Body3dScene* before = nullptr;
  int frame_before = 0, gaps = 0, first_gap = 0;
  for (const auto& [frame, scene] : scenes) {
    if (before && scene.univ_time_ms >= 0 && before->univ_time_ms >= 0 && scene.univ_time_ms <= before->univ_time_ms) {
      findings->Error("DAT-TIME", folder,
                      "univTime does not grow from frame " + std::to_string(frame_before) + " to " + std::to_string(frame));
    }
    if (before && frame != frame_before + 1 && ++gaps == 1) first_gap = frame_before + 1;
    before = &scene, frame_before = frame;
  }
  if (gaps > 0) {
    findings->Warning("DAT-GAP", folder,
                      std::to_string(gaps) + " gaps in the frame numbers, the first at frame " + std::to_string(first_gap));
  }
}

void CheckNames(const std::string& folder, const std::map<int, std::string>& files, Findings* findings) {
  std::set<std::string> known;
  for (const auto& [frame, path] : files) known.insert(path);
  for (const std::string& path : Glob(folder)) {
    if (!known.count(path)) findings->Warning("DAT-NAME", path, "is not named body3DScene_%08d.json and is not read");
  }
}

}  // namespace

namespace internal {

geometry::Rig VerifyCalibration(const std::string& path, Findings* findings) {
  geometry::Rig rig;
  try {
    const Json json = ParseJsonFile(path);
    const JsonView cameras = JsonView(path, json)["cameras"];
    std::set<std::string> names;
    if (cameras.ArraySize() == 0) cameras.Fail("is empty");
    for (size_t i = 0; i < cameras.ArraySize(); ++i) {
      try {
        VerifyCamera(cameras[i], path, &names, &rig, findings);
      } catch (const FormatError& error) {
        findings->Error("DAT-CALIB", path, WithoutPath(error));
      }
    }
  } catch (const FormatError& error) {
    findings->Error("DAT-CALIB", path, WithoutPath(error));
  }
  return rig;
}

std::map<int, Body3dScene> VerifyPoses(const std::string& root, Findings* findings) {
  std::map<int, Body3dScene> scenes;
  const std::string folder = root + "/hdPose3d_stage1_coco19";
  const auto files = ListBody3dScenes(root);
  if (files.empty()) findings->Error("DAT-POSE", folder, "holds no body3DScene_%08d.json");
  int implausible = 0, without_people = 0;
  for (const auto& [frame, path] : files) {
    try {
      const Body3dScene scene = ReadBody3dSceneFile(path);
      CheckPlausible(scene, path, &implausible, findings);
      without_people += scene.people.empty();
      scenes[frame] = scene;
    } catch (const FormatError& error) {
      const bool twice = std::string(error.what()).find("is there twice") != std::string::npos;
      findings->Error(twice ? "DAT-ID" : "DAT-POSE", path, WithoutPath(error));
    }
  }
  if (without_people > 0) findings->Warning("DAT-POSE", folder, std::to_string(without_people) + " frames hold no person");
  if (fs::is_directory(folder)) CheckNames(folder, files, findings);
  CheckOrder(scenes, folder, findings);
  return scenes;
}

}  // namespace internal

int VerifyReport::num_errors() const { return Count(findings, Finding::Severity::kError); }
int VerifyReport::num_warnings() const { return Count(findings, Finding::Severity::kWarning); }

namespace {

void CheckFolders(const std::string& root, const geometry::Rig& rig, Findings* findings) {
  for (const char* kind : {"hdImgs", "masks"}) {
    const fs::path folder = fs::path(root) / kind;
    if (!fs::is_directory(folder)) continue;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.is_directory() && rig.Find(entry.path().filename().string()) < 0) {
        findings->Error("DAT-NAME", entry.path().string(), "the calibration has no such camera");
      }
    }
  }
}

void CheckSidecar(const std::string& root, const geometry::Rig& rig, Findings* findings) {
  const std::string path = root + "/dataset.json";
  if (!fs::exists(path)) return;
  try {
    const Json json = internal::ParseJsonFile(path);
    const JsonView cameras = JsonView(path, json)["cameras"];
    for (size_t i = 0; i < cameras.ArraySize(); ++i) {
      cameras[i]["alias"].Text();
      const std::string name = cameras[i]["name"].Text();
      if (rig.Find(name) < 0)
        findings->Error("DAT-NAME", path, cameras[i].where() + ".name: the calibration has no camera " + name);
    }
  } catch (const FormatError& error) {
    findings->Error("DAT-SIDECAR", path, WithoutPath(error));
  }
}

std::vector<geometry::RigCamera> CamerasWithPictures(const std::string& root, const geometry::Rig& rig, Findings* findings) {
  std::vector<geometry::RigCamera> cameras;
  int panel = 0, node = 0;
  for (const auto& camera : rig.cameras) {
    if (fs::is_directory(fs::path(root) / "hdImgs" / camera.camera.name)) {
      cameras.push_back(camera);
    } else if (ParsePanopticName(camera.camera.name, &panel, &node) && panel == 0) {
      findings->Warning("DAT-IMAGE", root + "/hdImgs/" + camera.camera.name,
                        "the calibration has this camera, there are no pictures of it");
    }
  }
  if (cameras.empty()) findings->Error("DAT-IMAGE", root + "/hdImgs", "holds no pictures of any calibrated camera");
  return cameras;
}

}  // namespace

VerifyReport VerifyDataset(const std::string& root, const VerifyOptions& options, const RunContext& run) {
  if (options.picture_step < 1) throw UsageError("--picture-step must be at least 1");
  Findings findings;
  const geometry::Rig rig = internal::VerifyCalibration(FindPanopticCalibration(root), &findings);
  const auto scenes = internal::VerifyPoses(root, &findings);
  CheckFolders(root, rig, &findings);
  CheckSidecar(root, rig, &findings);
  const auto cameras = CamerasWithPictures(root, rig, &findings);

  std::vector<Findings> by_camera(cameras.size());
  std::vector<internal::PictureCounts> counts(cameras.size());
  ProgressStage stage(run, "pictures", static_cast<int64_t>(cameras.size()));
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(cameras.size()), run.num_threads, [&](int64_t i) {
    counts[i] = internal::VerifyPictures(root, cameras[i], scenes, options, &by_camera[i]);
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
  VerifyReport report;
  report.cameras = static_cast<int>(cameras.size());
  report.frames = static_cast<int>(scenes.size());
  for (size_t i = 0; i < cameras.size(); ++i) {
    findings.Append(by_camera[i]);
    report.pictures += counts[i].pictures;
    report.masks += counts[i].masks;
  }
  report.findings = findings.list();
  return report;
}

}  // namespace mvstudio::dataset
