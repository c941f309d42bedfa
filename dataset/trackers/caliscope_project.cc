#include <filesystem>

#include "core/error.h"
#include "dataset/trackers/project_readers.h"

namespace mvstudio::dataset::internal {

namespace fs = std::filesystem;

namespace {

/// The cameras of the day: caliscope keeps those that a recording was processed with beside its tables, as the project may be
/// calibrated anew. Older versions did not.
std::string CamerasOf(const std::string& tracker, const std::string& of_project) {
  const fs::path path = fs::path(tracker) / "camera_array.toml";
  std::error_code error;
  return fs::is_regular_file(path, error) ? path.string() : of_project;
}

}  // namespace

std::string FindCameraArray(const std::string& folder) {
  std::error_code error;
  for (const char* place : {"camera_array.toml", "calibration/extrinsic/capture_volume/camera_array.toml",
                            "calibration/extrinsic/camera_array.toml", "calibration/camera_array.toml"}) {
    const fs::path path = fs::path(folder) / place;
    if (fs::is_regular_file(path, error)) return path.string();
  }
  return "";
}

TrackedProject ReadCaliscopeProject(const std::string& folder, const std::string& camera_array) {
  TrackedProject project;
  project.program = "caliscope";
  std::error_code error;
  const fs::path recordings = fs::path(folder) / "recordings";
  const std::string above = fs::is_directory(recordings, error) ? recordings.string() : folder;
  for (const std::string& recording : ListFolder(above, true)) {
    for (const std::string& tracker : ListFolder(recording, true)) {
      const std::string name = fs::path(tracker).filename().string();
      const fs::path table = fs::path(tracker) / ("xy_" + name + ".csv");
      if (!fs::is_regular_file(table, error)) continue;
      const std::string cameras = CamerasOf(tracker, camera_array);
      if (cameras.empty()) {
        project.left_out.push_back(table.string() + ": no camera_array.toml beside it or in the project");
        continue;
      }
      project.takes.push_back({fs::path(recording).filename().string() + "/" + name, cameras, {}, table.string()});
    }
  }
  if (project.takes.empty()) {
    if (!project.left_out.empty()) throw FormatError(above, "", project.left_out[0]);
    throw FormatError(above, "", "holds no RECORDING/TRACKER/xy_TRACKER.csv; process a recording in caliscope first");
  }
  return project;
}

}  // namespace mvstudio::dataset::internal
