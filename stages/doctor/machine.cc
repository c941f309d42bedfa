#include "stages/doctor/machine.h"

#include <sys/statvfs.h>
#include <unistd.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

std::string LibavVersion(unsigned version) {
  return std::to_string(version >> 16) + "." + std::to_string(version >> 8 & 0xff) + "." + std::to_string(version & 0xff);
}

std::string EigenVersion() {
  return std::to_string(EIGEN_WORLD_VERSION) + "." + std::to_string(EIGEN_MAJOR_VERSION) + "." +
         std::to_string(EIGEN_MINOR_VERSION);
}

/// A line "Name:  123 kB" of /proc/meminfo in bytes; 0: not there.
double MemoryBytes(const std::string& name) {
  std::ifstream in("/proc/meminfo");
  for (std::string line; std::getline(in, line);) {
    if (line.rfind(name + ":", 0) == 0) return 1024 * std::atof(line.c_str() + name.size() + 1);
  }
  return 0;
}

double FreeDiskBytes(const std::string& folder) {
  struct statvfs disk {};
  if (statvfs(folder.c_str(), &disk) != 0) return 0;
  return static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize);
}

/// Where a program is found on PATH; empty: nowhere.
std::string FindProgram(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::string candidate = (fs::path(folder) / name).string();
    std::error_code none;
    if (!folder.empty() && access(candidate.c_str(), X_OK) == 0 && fs::is_regular_file(candidate, none)) return candidate;
  }
  return "";
}

fs::path ModelsFolder() {
  const char *own = std::getenv("MVSTUDIO_MODELS"), *cache = std::getenv("XDG_CACHE_HOME"), *home = std::getenv("HOME");
  if (own && *own) return own;
  if (cache && *cache) return fs::path(cache) / "mvstudio" / "models";
  return fs::path(home && *home ? home : ".") / ".cache" / "mvstudio" / "models";
}

std::vector<std::string> NamesIn(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

MachineState ExamineMachine(const std::string& folder) {
  MachineState machine;
  machine.libraries = {{"opencv", MVSTUDIO_OPENCV_VERSION},
                       {"eigen", EigenVersion()},
                       {"libavcodec", LibavVersion(avcodec_version())},
                       {"libavformat", LibavVersion(avformat_version())}};
  machine.cores = std::thread::hardware_concurrency();
  machine.memory_bytes = MemoryBytes("MemTotal"), machine.available_bytes = MemoryBytes("MemAvailable");
  machine.disk_folder = folder, machine.disk_free_bytes = FreeDiskBytes(folder);
  machine.programs = {
      {"colmap", "checks of COLMAP exports", ""}, {"npm", "models fetch", ""}, {"chromium", "images of the report", ""}};
  for (ProgramState& program : machine.programs) program.path = FindProgram(program.name);
  machine.models_folder = ModelsFolder().string(), machine.models = NamesIn(ModelsFolder());
  std::ifstream driver("/proc/driver/nvidia/version");
  if (driver) std::getline(driver, machine.nvidia_driver);
  std::error_code none;
  machine.has_gpu = fs::exists("/dev/nvidia0", none);
  return machine;
}

}  // namespace mvstudio::stages
