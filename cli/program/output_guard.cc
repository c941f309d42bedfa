#include "cli/program/output_guard.h"

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

}  // namespace mvstudio::cli
