#pragma once

#include <string>
#include <vector>

#include "dataset/session/session.h"

namespace mvstudio::dataset {

struct ScannedSession {
  std::vector<SessionCamera> cameras;  ///< by name
  std::vector<SessionTake> takes;      ///< board first
  std::vector<std::string> skipped;    ///< what lies there and is no footage, or has no usable name: one line each
};

/// Finds cameras and takes in folder/raw: raw/TAKE/CAMERA.mp4 (or .mkv, .mov, .avi, …), a folder or numbered pictures
/// raw/TAKE/CAMERA/*.png; raw/plate/CAMERA.png are plates; raw/TAKE/timestamps.csv is the take's table of times. Pictures that
/// lie loose in raw/TAKE are one picture a camera. Footage is named, not opened.
ScannedSession ScanSession(const std::string& folder);

/// The footage that lies in one folder, as a take called like it.
SessionTake ScanFolder(const std::string& folder, std::vector<SessionCamera>* cameras);

}  // namespace mvstudio::dataset
