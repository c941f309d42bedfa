#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dataset/session/session.h"

namespace mvstudio::dataset {

/// How folders of footage are read.
enum class SessionLayout {
  kAuto,         ///< by the names
  kTakeFirst,    ///< TAKE/CAMERA.mp4
  kCameraFirst,  ///< CAMERA/TAKE.mp4
};
std::string_view ToString(SessionLayout layout);  ///< "auto", "take-first", "camera-first"
/// Throws UsageError.
void FromString(const std::string& text, SessionLayout* layout);

struct ScannedSession {
  std::vector<SessionCamera> cameras;  ///< by name
  std::vector<SessionTake> takes;      ///< board first; paths begin with raw/
  std::vector<std::string> skipped;    ///< files that are not footage, or have no usable name: one line each
  SessionLayout layout = SessionLayout::kTakeFirst;
  std::vector<std::string> missing;  ///< chapters of recordings (chapters.h) that are not there though later ones are: paths
  std::vector<std::string> notes;    ///< assumptions about the layout: one line each
};

/// Finds cameras and takes in a folder that is, or will be, the session's raw/. TAKE/CAMERA.mp4 (or .mkv, .mov, .avi, …),
/// or a folder TAKE/CAMERA with numbered images, one video, or the chapters of one recording (chapters.h);
/// plate/CAMERA.png are clean plates; TAKE/timestamps.csv is the take's table of times. With cameras first: CAMERA/TAKE.mp4,
/// CAMERA/TAKE/*.png, CAMERA/plate.png. Images directly in TAKE are one image per camera. Footage is listed, not opened.
/// Throws FormatError when cameras have different numbers of recordings that only their order could pair.
ScannedSession ScanRaw(const std::string& raw, SessionLayout layout = SessionLayout::kAuto);
/// Same of folder/raw.
ScannedSession ScanSession(const std::string& folder);

/// Whether a name ends as those of videos do.
bool IsVideoFile(const std::string& path);

/// The footage in one folder, as a take with the folder's name; its paths are relative to the folder.
SessionTake ScanFolder(const std::string& folder, std::vector<SessionCamera>* cameras);

namespace internal {

/// The footage in raw/TAKE/CAMERA.* and raw/plate/CAMERA.*, for the session's cameras that have any. Throws FormatError when a
/// camera has two.
std::vector<SessionFootage> ScanFootage(const Session& session, const std::string& take);

}  // namespace internal
}  // namespace mvstudio::dataset
