#include "dataset/trackers/tracked_project.h"

#include <algorithm>
#include <filesystem>

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
