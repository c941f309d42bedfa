#pragma once

#include <string>
#include <vector>

#include "dataset/session/session.h"

namespace mvstudio::dataset {

struct ScannedSession {
  std::vector<SessionCamera> cameras;  ///< by name
  std::vector<SessionTake> takes;      ///< board first
  std::vector<std::string> skipped;    ///< files that are not footage, or have no usable name: one line each
};

/// Finds cameras and takes in folder/raw. raw/TAKE/CAMERA.mp4 (or .mkv, .mov, .avi, …), a folder or numbered pictures
/// raw/TAKE/CAMERA/*.png; raw/plate/CAMERA.png are clean plates; raw/TAKE/timestamps.csv is the take's table of times.
/// Pictures directly in raw/TAKE are one picture per camera. Footage is listed, not opened.
ScannedSession ScanSession(const std::string& folder);

/// The footage in one folder, as a take with the folder's name.
SessionTake ScanFolder(const std::string& folder, std::vector<SessionCamera>* cameras);

namespace internal {

/// The footage in raw/TAKE/CAMERA.* and raw/plate/CAMERA.*, for the session's cameras that have any. Throws FormatError when a
/// camera has two.
std::vector<SessionFootage> ScanFootage(const Session& session, const std::string& take);

}  // namespace internal
}  // namespace mvstudio::dataset
