#include <sys/statvfs.h>
#include <unistd.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/session/session_scan.h"
#include "stages/dataset/session_table.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

namespace mvstudio::cli {
namespace fs = std::filesystem;
namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string path;
  dataset::InspectOptions options;
};

std::string LibavVersion(unsigned version) {
  return std::to_string(version >> 16) + "." + std::to_string(version >> 8 & 0xff) + "." + std::to_string(version & 0xff);
}

ordered_json Libraries() {
  return {{"opencv", MVSTUDIO_OPENCV_VERSION},
          {"eigen", std::to_string(EIGEN_WORLD_VERSION) + "." + std::to_string(EIGEN_MAJOR_VERSION) + "." +
                        std::to_string(EIGEN_MINOR_VERSION)},
          {"libavcodec", LibavVersion(avcodec_version())},
          {"libavformat", LibavVersion(avformat_version())}};
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
    if (!folder.empty() && access(candidate.c_str(), X_OK) == 0 && fs::is_regular_file(candidate)) return candidate;
  }
  return "";
}

fs::path ModelsFolder() {
  const char *own = std::getenv("MVSTUDIO_MODELS"), *cache = std::getenv("XDG_CACHE_HOME"), *home = std::getenv("HOME");
  if (own && *own) return own;
  if (cache && *cache) return fs::path(cache) / "mvstudio" / "models";
  return fs::path(home && *home ? home : ".") / ".cache" / "mvstudio" / "models";
}

ordered_json Models() {
  ordered_json names = ordered_json::array();
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(ModelsFolder(), error)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return {{"folder", ModelsFolder().string()}, {"there", names}};
}

ordered_json Gpu() {
  std::ifstream driver("/proc/driver/nvidia/version");
  std::string line;
  const bool there = driver && std::getline(driver, line);
  return {{"nvidia_driver", there ? ordered_json(line) : ordered_json(nullptr)}, {"device", fs::exists("/dev/nvidia0")}};
}

CommandResult Programs() {
  CommandResult result;
  const struct {
    const char *name, *use;
  } programs[] = {{"colmap", "checks of COLMAP exports"}, {"npm", "models fetch"}, {"chromium", "images of the report"}};
  ordered_json& json = result.metrics["programs"] = ordered_json::object();
  for (const auto& program : programs) {
    const std::string path = FindProgram(program.name);
    json[program.name] = path.empty() ? ordered_json(nullptr) : ordered_json(path);
    if (path.empty()) {
      result.warnings.push_back(
          {"DOC-PROGRAM", std::string(program.name) + " is not on the PATH", std::string("needed for ") + program.use});
    }
  }
  return result;
}

std::string Gigabytes(double bytes) { return Format("%.1f GiB", bytes / (1 << 30)); }

/// The machine: what is there, and what is short.
CommandResult ExamineMachine(const std::string& folder) {
  CommandResult result;
  constexpr double kLeastDisk = 2.0 * (1 << 30), kLeastMemory = 2.0 * (1 << 30);
  ordered_json& m = result.metrics;
  const double memory = MemoryBytes("MemTotal"), available = MemoryBytes("MemAvailable"), disk = FreeDiskBytes(folder);
  m["version"] = MVSTUDIO_VERSION;
  m["avatar"] = MVSTUDIO_HAS_AVATAR != 0;
  m["libraries"] = Libraries();
  m["cores"] = std::thread::hardware_concurrency();
  m["memory_bytes"] = {{"total", memory}, {"available", available}};
  m["disk_free_bytes"] = disk;
  result.Add(Programs());
  m["models"] = Models();
  m["gpu"] = Gpu();
  if (disk < kLeastDisk)
    result.warnings.push_back({"DOC-DISK", "only " + Gigabytes(disk) + " are free at " + folder, "make room"});
  if (available > 0 && available < kLeastMemory) {
    result.warnings.push_back({"DOC-MEMORY", "only " + Gigabytes(available) + " of memory are free", "end other programs"});
  }
  if (m["models"]["there"].empty()) {
    result.warnings.push_back({"DOC-MODELS", "no models in " + ModelsFolder().string(), "mvstudio models fetch"});
  }
  std::string libraries;
  for (const auto& [name, version] : m["libraries"].items()) {
    libraries += (libraries.empty() ? "" : ", ") + name + " " + version.get<std::string>();
  }
  result.text = std::string("mvstudio ") + MVSTUDIO_VERSION + " (" + libraries + ")\n" +
                std::to_string(std::thread::hardware_concurrency()) + " cores, " + Gigabytes(available) + " of " +
                Gigabytes(memory) + " memory free, " + Gigabytes(disk) + " of disk free, " +
                (m["gpu"]["device"].get<bool>() ? "an NVIDIA GPU" : "no GPU") + "\n";
  return result;
}

/// Reads the folder itself as a session's raw/: CAMERA/TAKE.mp4 and the like.
void TakeFromRaw(const std::string& path, dataset::Session* session) {
  const dataset::ScannedSession scanned = dataset::ScanRaw(path);
  session->cameras = scanned.cameras;
  session->takes = scanned.takes;
  for (dataset::SessionTake& take : session->takes) {
    for (dataset::SessionFootage& footage : take.footage) {
      for (std::string* file : {&footage.path, &footage.plate}) {
        if (file->rfind("raw/", 0) == 0) file->erase(0, 4);
      }
    }
  }
}

dataset::Session SessionAt(const std::string& path, stages::InputNotes* notes) {
  if (!fs::exists(path)) throw IoError(path, "no such session or folder");
  if (!fs::is_directory(path) || fs::exists(fs::path(path) / "mvstudio.toml")) return dataset::ReadSession(path);
  dataset::Session session;
  session.folder = path;
  session.units = "m";
  const dataset::ScannedSession scanned = dataset::ScanSession(path);
  session.cameras = scanned.cameras;
  session.takes = scanned.takes;
  if (scanned.takes.empty()) session.takes = {dataset::ScanFolder(path, &session.cameras)};
  if (session.cameras.empty()) TakeFromRaw(path, &session);
  notes->warnings.push_back({"SES-NONE", path + " holds no mvstudio.toml: checked as a folder of footage",
                             "make a session with mvstudio session init"});
  return session;
}

/// A board that no take shows: the folders were perhaps read the wrong way round.
void WarnOfBoard(const dataset::Session& session, stages::InputNotes* notes) {
  const auto shows_board = [](const dataset::SessionTake& take) { return take.kind == dataset::TakeKind::kBoard; };
  if (session.board.empty() || std::any_of(session.takes.begin(), session.takes.end(), shows_board)) return;
  notes->warnings.push_back({"SES-BOARD", "the session has a board (" + session.board + ") and no take of kind board",
                             "give a take kind = \"board\" in mvstudio.toml; if cameras and takes are exchanged, run "
                             "session init again with --layout"});
}

CommandResult Run(const Arguments& arguments, CommandContext& context) {
  const bool folder = !arguments.path.empty() && fs::is_directory(arguments.path);
  CommandResult result = ExamineMachine(folder ? arguments.path : ".");
  if (arguments.path.empty()) return result;
  const dataset::Session session = SessionAt(arguments.path, &result);
  dataset::SessionReport report = dataset::InspectSession(session, arguments.options, context.run);
  const bool bare = !fs::exists(fs::path(session.folder) / "mvstudio.toml");
  if (bare && session.cameras.empty()) {
    report.findings.push_back({"SES-NO-FOOTAGE", arguments.path + ": no footage was found in it",
                               "name a session, or a folder with TAKE/CAMERA.mp4, CAMERA/TAKE.mp4 or CAMERA.mp4", true});
  }
  result.inputs = {arguments.path};
  WarnOfBoard(session, &result);
  result.metrics["footage"] = stages::FootageJson(report);
  result.metrics["findings"] = ordered_json::array();
  for (const Notice& f : report.findings) {
    result.metrics["findings"].push_back({{"severity", f.fails ? "error" : "warning"}, {"code", f.code}, {"text", f.text}});
  }
  result.Add(stages::DescribeFootageFindings(report));
  result.text += stages::FootageText(report) + stages::Counted(static_cast<int64_t>(result.errors.size()), "error") + ", " +
                 stages::Counted(static_cast<int64_t>(result.warnings.size()), "warning") + "\n";
  return result;
}

}  // namespace

void RegisterDoctor(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("doctor", "Check the machine, and a session; lists every problem, not only the first");
  AddOption(sub, "path", arguments->path, "a session, or a folder of footage");
  AddFlag(sub, "--decode", arguments->options.decode, "decode every frame, instead of reading time stamps only");
  AddFlag(sub, "--allow-outside", arguments->options.allow_outside, "allow the session to name files outside its folder");
  registry.Add(sub, "doctor", [arguments](CommandContext& context) { return Run(*arguments, context); });
}

}  // namespace mvstudio::cli
