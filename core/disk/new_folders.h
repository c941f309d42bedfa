#pragma once

#include <string>
#include <vector>

namespace mvstudio {

/// Folders of a command that may still fail: those that it made go again, where they are empty, unless they are kept.
class NewFolders {
 public:
  NewFolders() = default;
  ~NewFolders();
  NewFolders(const NewFolders&) = delete;
  NewFolders& operator=(const NewFolders&) = delete;
  /// Like MakeFolder.
  void Make(const std::string& path);
  void Keep();

 private:
  std::vector<std::string> made_;  ///< a folder comes before those in it
};

}  // namespace mvstudio
