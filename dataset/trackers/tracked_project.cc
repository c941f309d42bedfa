#include "dataset/trackers/tracked_project.h"

#include <algorithm>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/some_of.h"
#include "dataset/trackers/project_readers.h"

namespace mvstudio::dataset {

namespace fs = std::filesystem;

namespace internal {

std::vector<std::string> ListFolder(const std::string& folder, bool folders) {
  constexpr size_t kMaxEntries = 100'000;
  std::vector<std::string> paths;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    if (entry->path().filename().string()[0] == '.') continue;
    if (folders ? entry->is_directory(ignored) : entry->is_regular_file(ignored)) paths.push_back(entry->path().string());
    if (paths.size() > kMaxEntries)
      throw FormatError(folder, "", "holds more than " + std::to_string(kMaxEntries) + " entries");
  }
  if (error) throw IoError(folder, "cannot be listed: " + error.message());
  std::sort(paths.begin(), paths.end());
  return paths;
}

}  // namespace internal

namespace {

std::string FirstThatEnds(const std::string& folder, const std::string& end) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) return "";
  for (const std::string& path : internal::ListFolder(folder, false)) {
    if (path.size() > end.size() && path.compare(path.size() - end.size(), end.size(), end) == 0) return path;
  }
  return "";
}

/// A recording of FreeMoCap: its videos, its calibration and its 3D joints can be used, its arrays of 2D points cannot.
void RefuseFreeMoCap(const std::string& folder) {
  constexpr char kCalibration[] = "_camera_calibration.toml",
                 kPoints[] = "2dData_numCams_numFrames_numTrackedPoints_pixelXY.npy";
  const std::string calibration = FirstThatEnds(folder, kCalibration);
  std::string points = FirstThatEnds(folder + "/output_data/raw_data", kPoints);
  if (points.empty()) points = FirstThatEnds(folder + "/output_data", kPoints);
  if (calibration.empty() && points.empty()) return;
  throw FormatError(folder, "",
                    "is a recording of FreeMoCap; " + (points.empty() ? "its array of 2D points" : points) +
                        " is not read (its 3D joints are: mvstudio markers convert " + folder +
                        "); find the joints in synchronized_videos again (mvstudio pose2d) and triangulate them with " +
                        "option 'calib' " + (calibration.empty() ? std::string("*") + kCalibration : calibration));
}

/// A project of DeepLabCut, of one camera or of two.
void RefuseDeepLabCut(const std::string& folder) {
  const std::string path = folder + "/config.yaml";
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return;
  const std::string text = ReadFile(path);
  const bool stereo = text.find("scorername_3d") != std::string::npos;
  if (!stereo && text.find("bodyparts") == std::string::npos) return;
  throw FormatError(path, "",
                    std::string("is a project of DeepLabCut; ") +
                        (stereo ? "its calibration (camera_matrix/*.pickle) is not read: calibrate the cameras from "
                                  "calibration_images (mvstudio calibrate), and give"
                                : "give a calibration of the cameras, and") +
                        " each camera's result, option 'pose2d' CAMERA=VIDEODLC_….h5 or .csv" +
                        (stereo ? "; its 3D joints (*_DLC_3D.h5, .csv) are read by mvstudio markers convert" : ""));
}

}  // namespace

TrackedProject ReadTrackedProject(const std::string& folder) {
  RequireFolder(folder, "; give the folder of an anipose, caliscope or Pose2Sim project");
  std::error_code error;
  const std::string array = internal::FindCameraArray(folder);
  TrackedProject project;
  if (!array.empty() || fs::is_directory(fs::path(folder) / "recordings", error)) {
    project = internal::ReadCaliscopeProject(folder, array);
  } else if (fs::is_regular_file(fs::path(folder) / "config.toml", error)) {
    project = internal::ReadAniposeProject(folder);
  } else if (internal::IsPose2SimProject(folder)) {
    project = internal::ReadPose2SimProject(folder);
  } else {
    RefuseFreeMoCap(folder);
    RefuseDeepLabCut(folder);
    throw FormatError(folder, "",
                      "holds neither config.toml (anipose) nor Config.toml (Pose2Sim) nor camera_array.toml (caliscope)");
  }
  std::sort(project.takes.begin(), project.takes.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return project;
}

const TrackedProject::Take& FindTake(const TrackedProject& project, const std::string& name) {
  if (name.empty() && project.takes.size() == 1) return project.takes[0];
  for (const TrackedProject::Take& take : project.takes) {
    if (take.name == name) return take;
  }
  std::vector<std::string> names;
  for (const TrackedProject::Take& take : project.takes) names.push_back(take.name);
  throw UsageError(
      (name.empty() ? "the project has several takes; name one by option 'take': " : "no take `" + name + "`; there are ") +
      SomeOf(names, 20));
}

}  // namespace mvstudio::dataset
