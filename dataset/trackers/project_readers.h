// Private: for the readers of this folder.
#pragma once

#include <string>
#include <vector>

#include "dataset/trackers/tracked_project.h"

namespace mvstudio::dataset::internal {

/// Folders, or files, in a folder, sorted; hidden ones are left out. Throws IoError.
std::vector<std::string> ListFolder(const std::string& folder, bool folders);

/// caliscope's calibration in the places where its versions put it; empty when there is none.
std::string FindCameraArray(const std::string& folder);
/// `camera_array` may be empty where every recording has its own.
TrackedProject ReadCaliscopeProject(const std::string& folder, const std::string& camera_array);
TrackedProject ReadAniposeProject(const std::string& folder);
/// Whether the folder, or one above that a trial belongs to, has a Config.toml.
bool IsPose2SimProject(const std::string& folder);
TrackedProject ReadPose2SimProject(const std::string& folder);

}  // namespace mvstudio::dataset::internal
