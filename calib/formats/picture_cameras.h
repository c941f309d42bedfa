// Private: for the readers of formats that list pictures, each with a pose.
#pragma once

#include <string>
#include <vector>

#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"

namespace mvstudio::calib::internal {

/// A picture of a file: its path there, the name it would give its camera, lens and pose.
struct PictureCamera {
  std::string path, name;
  geometry::RigCamera camera;
  Place place;
};

/// The cameras that took the pictures. Pictures of one folder, or of one name in several folders, that share pose and lens are
/// one camera: `cam1/000000.jpg`, `cam1/000001.jpg`. Where file names repeat, a camera is named by its folder. Notes say both,
/// and when the pictures of a folder stand at different places. Throws FormatError for names that are used twice nevertheless.
void AddPictureCameras(std::vector<PictureCamera> pictures, ImportedRig* imported);

}  // namespace mvstudio::calib::internal
