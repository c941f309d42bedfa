#include "cli/program/output_guard.h"

#include <filesystem>

namespace mvstudio::cli {

std::vector<std::string> PathsIn(const std::vector<stages::NamedPath>& named) {
  std::vector<std::string> paths;
  for (const stages::NamedPath& each : named) paths.push_back(each.path);
  return paths;
}

std::vector<std::string> Joined(std::vector<std::string> first, const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

bool KeepsOlder(const std::string& path, stages::CommandResult* result) {
  if (result->exit != stages::kExitIllPosed || !std::filesystem::exists(path)) return false;
  result->warnings.push_back({"CLI-OLDER-KEPT", path + ": of an earlier run, was kept, for this one found nothing", ""});
  result->folder.clear();
  return true;
}

}  // namespace mvstudio::cli
