#pragma once

#include <string>
#include <utility>
#include <vector>

namespace mvstudio::stages {

/// A program that some command calls.
struct ProgramState {
  std::string name, use;
  std::string path;  ///< empty: it is not on the PATH
};

struct MachineState {
  std::vector<std::pair<std::string, std::string>> libraries;  ///< name and version
  unsigned cores = 0;
  double memory_bytes = 0, available_bytes = 0;  ///< 0: the system does not say
  std::string disk_folder;
  double disk_free_bytes = 0;
  std::vector<ProgramState> programs;
  std::string models_folder;
  std::vector<std::string> models;  ///< what lies there
  std::string nvidia_driver;        ///< its line of /proc; empty: none
  bool has_gpu = false;
};

/// Of this machine; the disk is that of `folder`. Never throws.
MachineState ExamineMachine(const std::string& folder);

}  // namespace mvstudio::stages
