#include "cli/program/output_guard.h"

namespace mvstudio::cli {

std::vector<std::string> PathsIn(const std::vector<std::string>& words) {
  std::vector<std::string> paths = words;
  for (const std::string& word : words) {
    const size_t equals = word.find('=');
    if (equals != std::string::npos) paths.push_back(word.substr(equals + 1));
  }
  return paths;
}

std::vector<std::string> PathsOf(const std::vector<dataset::CameraFootage>& footage) {
  std::vector<std::string> paths;
  for (const dataset::CameraFootage& camera : footage) paths.insert(paths.end(), {camera.path, camera.plate});
  return paths;
}

std::vector<std::string> Joined(std::vector<std::string> first, const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

}  // namespace mvstudio::cli
