// Private: how folders of footage are read as takes and cameras, for session_scan.cc.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/session/session_scan.h"

namespace mvstudio::dataset::internal {

/// A folder of footage as found: what lies in it by name, each with the paths that have the name.
struct FootageFolder {
  std::string name;
  std::map<std::string, std::vector<std::string>> footage;
};

/// The layout of the folders, and a sentence for the user where their names leave it open or tell against TAKE/CAMERA. A
/// reading is better when names that say so are where it has them (board, calib; cam1, gopro2), and when it gives several
/// cameras where the other gives one. Of equal ones: TAKE/CAMERA.
struct FoundLayout {
  SessionLayout layout = SessionLayout::kTakeFirst;
  std::string conflict;
};
/// `has_plates`: there is a folder of clean plates beside them, as among takes.
FoundLayout FindLayout(const std::vector<FootageFolder>& folders, bool has_plates);

/// The folders of cameras as folders of takes, in the order of the takes' names. Recordings that every camera numbers by
/// itself (GoPro) are paired in their order, as take1, take2, …; `note` says so. Throws FormatError with `path` when the
/// cameras have different numbers of them.
std::vector<FootageFolder> TakesOfCameras(const std::string& path, const std::vector<FootageFolder>& cameras,
                                          std::string* note);

}  // namespace mvstudio::dataset::internal
