#pragma once

#include <string>
#include <vector>

#include "dataset/session/session.h"
#include "geometry/rig/rig.h"

/// A library of lenses: a calibration file without poses, whose cameras are called SERIAL@SETTING. Lenses that are kept at a
/// setting need not be calibrated again; their cameras are then placed by few boards, marks or people.
namespace mvstudio::stages {

/// Whose lens it is, and how it is set ("35mm f4, focus 2 m"); neither holds '@', and the serial number is not empty.
struct LensKey {
  std::string serial, setting;
};
std::string LensName(const LensKey& key);

/// Reads a library. Throws IoError, FormatError for another calibration file.
geometry::Rig ReadLensLibrary(const std::string& path);

/// Adds the lens of a calibrated camera with its covariance; an empty library is started. Throws UsageError for names that
/// cannot be, and for a lens that is there already unless `replace`.
void AddLens(const geometry::RigCamera& camera, const LensKey& key, bool replace, geometry::Rig* library);

/// The lenses of a session's cameras under the cameras' names, as a rig without poses (calib::kLensesOnly). A camera is found
/// by its serial number and, where the library has several settings of it, by its `lens`. Cameras without a serial number or
/// without a lens in the library are left out. Throws UsageError that lists the settings where none of several is named.
geometry::Rig LensesOf(const geometry::Rig& library, const std::vector<dataset::SessionCamera>& cameras);

}  // namespace mvstudio::stages
