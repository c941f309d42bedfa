#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>

namespace mvstudio::testing {

/// Makes a file as a user would, with its folders: nothing that mvstudio wrote.
inline void Put(const std::string& path, const std::string& content) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream(path, std::ios::binary) << content;
}

/// Names in a folder, without the list of our own files.
inline std::set<std::string> Entries(const std::string& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().filename() != ".mvstudio.json") names.insert(entry.path().filename().string());
  }
  return names;
}

/// Every file below a folder with its content (symbolic links: where they point to), by path.
inline std::map<std::string, std::string> StateOf(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().string().substr(folder.size());
    std::ostringstream content;
    if (entry.is_symlink()) {
      content << "-> " << std::filesystem::read_symlink(entry.path()).string();
    } else if (entry.is_regular_file()) {
      content << std::ifstream(entry.path(), std::ios::binary).rdbuf();
    } else {
      content << "/";
    }
    files[name] = content.str();
  }
  return files;
}

}  // namespace mvstudio::testing
