#include "dataset/verify/verify.h"

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <set>

#include "core/disk/kept.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/parallel.h"
#include "dataset/json/json_file.h"
#include "dataset/panoptic/in_view.h"
#include "dataset/verify/findings.h"
#include "dataset/verify/image_mask.h"
#include "dataset/verify/verify_steps.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using internal::Findings;
using internal::FootageCheck;
using internal::Json;
using internal::JsonView;
using internal::WithoutPath;

int Count(const std::vector<Finding>& findings, Finding::Severity severity) {
  return static_cast<int>(
      std::count_if(findings.begin(), findings.end(), [&](const Finding& f) { return f.severity == severity; }));
}

/// Strange names, one line a folder and reason's first word.
void ReportNames(const PanopticSequence& sequence, Findings* findings) {
  std::map<std::string, std::vector<size_t>> by_folder;
  for (size_t i = 0; i < sequence.strange.size(); ++i)
    by_folder[fs::path(sequence.strange[i].first).parent_path().string()].push_back(i);
  for (const auto& [folder, entries] : by_folder) {
    const auto& [path, why] = sequence.strange[entries[0]];
    findings->Warning("DAT-NAME", path,
                      why + (entries.size() > 1 ? "; " + std::to_string(entries.size() - 1) + " more of this folder" : ""));
  }
}

void ReportLinks(const PanopticSequence& sequence, bool followed, Findings* findings) {
  for (const auto& [path, target] : sequence.links_out) {
    const std::string text = "is a symbolic link out of the folder, to " + internal::Quoted(target);
    if (followed) {
      findings->Warning("DAT-LINK", path, text);
    } else {
      findings->Error("DAT-LINK", path, text + ", and is not read; option 'follow-links' reads through it");
    }
  }
}

bool HasOwnFolder(const PanopticSequence& sequence, const std::string& camera, const std::string& kind = "hdImgs") {
  const fs::path folder = fs::path(sequence.root) / kind / camera;
  return kind != "masks" && fs::is_directory(folder) && !fs::is_symlink(folder) && !fs::is_symlink(folder.parent_path());
}

/// Folders of masks and footage without a camera, and of cameras without footage.
void CheckFolders(const PanopticSequence& sequence, const geometry::Rig& rig, Findings* findings) {
  for (const auto& [camera, footage] : sequence.footage) {
    if (rig.Find(camera) < 0) findings->Error("DAT-NAME", footage.path, "the calibration has no such camera");
    if (!footage.other.empty())
      findings->Warning("DAT-IMAGE", footage.other, "is not read: " + footage.path + " is taken for this camera");
  }
  for (const char* name : {"masks", "hdImgs", "vgaImgs", "kinectImgs"}) {
    const fs::path folder = fs::path(sequence.root) / name;
    for (const std::string& camera : NamesIn(folder.string())) {
      const bool told = std::string(name) != "masks" && sequence.footage.count(camera);
      if (fs::is_directory(folder / camera) && !told && rig.Find(camera) < 0)
        findings->Error("DAT-NAME", (folder / camera).string(), "the calibration has no such camera");
      if (rig.Find(camera) >= 0 && !sequence.footage.count(camera) && HasOwnFolder(sequence, camera, name))
        findings->Error("DAT-IMAGE", (folder / camera).string(), "holds no image of this camera");
    }
  }
}

void CheckSidecar(const std::string& root, const geometry::Rig& rig, Findings* findings) {
  const std::string path = root + "/dataset.json";
  if (!fs::exists(path)) return;
  try {
    const Json json = internal::ParseJsonFile(path);
    const JsonView cameras = JsonView(path, json)["cameras"];
    std::set<std::string> known;
    for (const auto& camera : rig.cameras) known.insert(camera.camera.name);
    for (size_t i = 0; i < cameras.ArraySize(); ++i) {
      cameras[i]["alias"].Text();
      const std::string name = cameras[i]["name"].Text();
      if (!known.count(name)) {
        findings->Error("DAT-NAME", path,
                        cameras[i].where() + ".name: the calibration has no camera " + internal::Quoted(name));
      }
    }
  } catch (const FormatError& error) {
    findings->Error("DAT-SIDECAR", path, WithoutPath(error));
  }
}

/// A calibration with joints alone is fine; one whose footage is of other cameras is not.
std::vector<geometry::RigCamera> CamerasWithFootage(const PanopticSequence& sequence, const geometry::Rig& rig,
                                                    Findings* findings) {
  std::vector<geometry::RigCamera> cameras;
  for (const auto& camera : rig.cameras) {
    if (sequence.footage.count(camera.camera.name)) cameras.push_back(camera);
  }
  if (!cameras.empty()) {
    std::vector<std::string> without;
    for (const auto& camera : rig.cameras) {
      const std::string& name = camera.camera.name;
      if (KindOfCamera(name) == PanopticKind::kHd && !sequence.footage.count(name) && !HasOwnFolder(sequence, name))
        without.push_back(name);
    }
    if (!without.empty()) {
      findings->Warning("DAT-IMAGE", sequence.root + "/hdImgs/" + without[0],
                        "the calibration has this camera, there are no images of it" +
                            (without.size() > 1 ? "; nor of " + std::to_string(without.size() - 1) + " more" : ""));
    }
  } else if (!sequence.footage.empty()) {
    findings->Error("DAT-IMAGE", sequence.root, "holds no images of any calibrated camera");
  } else {
    findings->Warning("DAT-IMAGE", sequence.root, "holds neither images nor videos: calibration and joints only");
  }
  return cameras;
}

/// Of HD images alone: there are no masks of others. Cameras that were exchanged are named once.
void CompareImages(const PanopticSequence& sequence, const std::vector<geometry::RigCamera>& cameras,
                   const std::map<int, Body3dScene>& scenes, const std::optional<MaskMeaning>& masks, const RunContext& run,
                   Findings* findings) {
  CameraFrames all, masked;
  PanopticDataset files;
  files.root = sequence.root;
  for (const geometry::RigCamera& camera : cameras) {
    const std::string& name = camera.camera.name;
    const PanopticFootage& footage = sequence.footage.at(name);
    if (footage.is_video || KindOfCamera(name) != PanopticKind::kHd) continue;
    files.rig.cameras.push_back(camera);
    for (const auto& [frame, file] : footage.images) all[name].push_back(frame);
    if (fs::is_directory(sequence.root + "/masks/" + name)) masked[name] = all[name];
  }
  std::vector<Finding> found;
  if (masks) found = CompareImagesWithMasks(files, *masks, masked, run);
  for (const auto& [frame, scene] : scenes) files.poses[frame] = scene.people;
  if (found.empty()) found = CompareImagesWithJoints(files, all, run);
  for (const Finding& finding : found) findings->Add(finding);
}

/// Whether the camera was checked before; damaged bytes count as nothing.
bool TakeKept(const KeptChecks& kept, const std::string& camera, FootageCheck* check, Findings* findings) {
  const std::optional<std::string> bytes = kept.load ? kept.load(camera) : std::nullopt;
  if (!bytes) return false;
  try {
    Findings found;
    *check = internal::CheckFromBytes(*bytes, &found);
    *findings = found;
    return true;
  } catch (const DamagedBytes&) {
    return false;
  }
}

std::vector<FootageCheck> CheckFootage(const PanopticSequence& sequence, const std::vector<geometry::RigCamera>& cameras,
                                       const std::map<int, Body3dScene>& hd, const std::map<int, Body3dScene>& vga,
                                       const VerifyOptions& options, const KeptChecks& kept, const RunContext& run,
                                       Findings* findings) {
  std::vector<Findings> by_camera(cameras.size());
  std::vector<FootageCheck> checks(cameras.size());
  const std::map<int, Body3dScene> none;
  const std::optional<MaskMeaning> masks = internal::VerifyMaskValues(sequence, findings);
  ProgressStage stage(run, "pictures", static_cast<int64_t>(cameras.size()));
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(cameras.size()), run.num_threads, [&](int64_t i) {
    const auto k = static_cast<size_t>(i);
    if (kept.count > 0 && i % kept.count != kept.index) return;
    const std::string& name = cameras[k].camera.name;
    const PanopticFootage& footage = sequence.footage.at(name);
    const PanopticKind kind = KindOfCamera(name);
    const auto& scenes = kind == PanopticKind::kHd ? hd : kind == PanopticKind::kVga ? vga : none;
    if (!TakeKept(kept, name, &checks[k], &by_camera[k])) {
      checks[k] = footage.is_video
                      ? internal::VerifyVideo(cameras[k], footage, scenes, options, &by_camera[k])
                      : internal::VerifyImages(sequence, cameras[k], footage, scenes, masks, options, &by_camera[k]);
      if (kept.store) kept.store(name, internal::BytesOfCheck(checks[k], by_camera[k].list()));
    }
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
  for (const Findings& f : by_camera) findings->Append(f);
  if (kept.count > 0) return checks;
  internal::CompareCameras(cameras, checks, sequence, findings);
  CompareImages(sequence, cameras, hd, masks, run, findings);
  return checks;
}

/// Each camera's own warning says little where it is all of them.
void CheckInView(const PanopticSequence& sequence, const geometry::Rig& rig, const std::map<int, Body3dScene>& scenes,
                 Findings* findings) {
  std::map<int, std::map<int, Coco19Pose>> poses;
  for (const auto& [frame, scene] : scenes) poses[frame] = scene.people;
  const NotInView why = WhyNotInView(rig, poses);
  const size_t colon = why.text.find(": ");
  if (!why.text.empty()) findings->Error(why.text.substr(0, colon), sequence.calibration, why.text.substr(colon + 2));
}

std::string WhyUnusable(const geometry::Rig& rig, const VerifyReport& report) {
  if (rig.cameras.empty()) return "no camera of the calibration can be read";
  if (report.frames == 0 && report.images + report.videos == 0) return "there are neither joints nor images that can be read";
  return "";
}

}  // namespace

namespace internal {

std::string WithoutPath(const FormatError& error) {
  const std::string text = error.what();
  return text.compare(0, error.path().size() + 2, error.path() + ": ") == 0 ? text.substr(error.path().size() + 2) : text;
}

}  // namespace internal

int VerifyReport::num_errors() const { return Count(findings, Finding::Severity::kError); }
int VerifyReport::num_warnings() const { return Count(findings, Finding::Severity::kWarning); }

VerifyReport VerifyDataset(const std::string& root, const VerifyOptions& options, const RunContext& run,
                           const KeptChecks& kept) {
  if (options.image_step < 1) throw UsageError("option 'picture-step' must be at least 1");
  Findings findings;
  const PanopticSequence sequence = ScanPanopticSequence(root, options.follow_links);
  const geometry::Rig rig = internal::VerifyCalibration(sequence.calibration, &findings);
  ReportLinks(sequence, options.follow_links, &findings);
  if (sequence.hd_scenes.files.empty())
    findings.Error("DAT-POSE", root, "holds no hdPose3d_stage1_coco19/body3DScene_%08d.json");
  const auto hd = internal::VerifyScenes(sequence.hd_scenes, &findings);
  const auto vga = internal::VerifyScenes(sequence.vga_scenes, &findings);
  VerifyReport report;
  report.frames = static_cast<int>(hd.size());
  report.own_frames = internal::VerifyOwnJoints(root, hd, &report.skeleton, &findings);
  report.faces = internal::VerifyLandmarks(sequence.faces, internal::LandmarkKind::kFaces, hd, &findings);
  report.hands = internal::VerifyLandmarks(sequence.hands, internal::LandmarkKind::kHands, hd, &findings);
  internal::VerifySyncTables(sequence, hd, &findings);
  ReportNames(sequence, &findings);
  CheckFolders(sequence, rig, &findings);
  CheckSidecar(root, rig, &findings);
  CheckInView(sequence, rig, hd, &findings);
  const auto cameras = CamerasWithFootage(sequence, rig, &findings);
  report.cameras = static_cast<int>(cameras.size());
  const std::vector<FootageCheck> checks = CheckFootage(sequence, cameras, hd, vga, options, kept, run, &findings);
  for (size_t i = 0; i < checks.size(); ++i) {
    const FootageCheck& check = checks[i];
    const std::string& name = cameras[i].camera.name;
    if (check.no_image > 0) report.no_image[name] = check.no_image;
    if (check.no_mask > 0) report.no_mask[name] = check.no_mask;
    report.images += static_cast<int>(check.images);
    report.masks += static_cast<int>(check.masks);
    report.videos += static_cast<int>(check.videos);
  }
  report.unusable = WhyUnusable(rig, report);
  report.findings = findings.list();
  return report;
}

}  // namespace mvstudio::dataset
