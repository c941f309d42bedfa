#include "cli/result.h"

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <new>

#include "cli/console.h"
#include "core/error.h"
#include "core/files.h"
#include "core/sha256.h"

namespace mvstudio::cli {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

constexpr uintmax_t kMaxHashedBytes = 2ull << 30;

std::string StatusName(const CommandResult& result) {
  switch (result.exit) {
    case kExitOk:
      return result.warnings.empty() ? "ok" : "warn";
    case kExitQualityGate:
      return "fail";
    case kExitPartial:
      return "partial";
    default:
      return "error";
  }
}

Json NoticesToJson(const std::vector<Notice>& notices) {
  Json list = Json::array();
  for (const Notice& notice : notices) {
    Json item = {{"code", notice.code}, {"text", notice.text}};
    if (!notice.hint.empty()) item["hint"] = notice.hint;
    list.push_back(item);
  }
  return list;
}

double PeakRssMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

std::vector<std::string> FilesBelow(const std::string& path) {
  if (!fs::is_directory(path)) return fs::exists(path) ? std::vector<std::string>{path} : Glob(path);
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file()) files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Digest of a file, or of the list of digests of a folder's files; too much data is described by its size alone.
Json Fingerprint(const std::string& path) {
  const std::vector<std::string> files = FilesBelow(path);
  uintmax_t bytes = 0;
  for (const std::string& file : files) bytes += fs::file_size(file);
  Json item = {{"path", path}, {"files", files.size()}, {"bytes", bytes}};
  if (files.empty() || bytes > kMaxHashedBytes) return item;
  if (files.size() == 1) {
    item["sha256"] = Sha256File(files.front());
    return item;
  }
  Sha256 all;
  for (const std::string& file : files) {
    const std::string line = Sha256File(file) + " " + file.substr(std::min(path.size(), file.size())) + "\n";
    all.Update(line.data(), line.size());
  }
  item["sha256_of_list"] = all.HexDigest();
  return item;
}

std::string UtcNow() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&now));
  return text;
}

CommandResult ErrorResult(int exit, const std::string& code, const std::string& text, const std::string& hint = {}) {
  CommandResult result;
  result.exit = exit;
  result.errors.push_back({code, text, hint});
  return result;
}

}  // namespace

Json ResultToJson(const std::string& command, const CommandResult& result, double wall_s,
                  const std::vector<std::string>& argv) {
  Json outputs = Json::array();
  for (const auto& output : result.outputs) {
    Json item = {{"path", output.path}};
    if (!output.role.empty()) item["role"] = output.role;
    outputs.push_back(item);
  }
  return {{"schema", "mvstudio.result/1"},
          {"command", command},
          {"version", MVSTUDIO_VERSION},
          {"status", StatusName(result)},
          {"exit", result.exit},
          {"metrics", result.metrics},
          {"outputs", outputs},
          {"warnings", NoticesToJson(result.warnings)},
          {"errors", NoticesToJson(result.errors)},
          {"timing", {{"wall_s", wall_s}, {"peak_rss_mb", PeakRssMb()}}},
          {"argv", argv}};
}

void KeepResult(const std::string& command, const CommandResult& result, const Json& json,
                const std::vector<std::string>& argv) {
  if (result.folder.empty()) return;
  std::string name = command;
  std::replace(name.begin(), name.end(), ' ', '_');
  const std::string path = result.folder + "/" + name + ".result.json";
  Json line = {{"time", UtcNow()}, {"command", command}, {"version", MVSTUDIO_VERSION}, {"argv", argv}, {"exit", result.exit}};
  line["inputs"] = Json::array();
  line["outputs"] = Json::array();
  for (const std::string& input : result.inputs) line["inputs"].push_back(Fingerprint(input));
  for (const auto& output : result.outputs) line["outputs"].push_back(Fingerprint(output.path));
  line["wall_s"] = json["timing"]["wall_s"];
  AppendLine(result.folder + "/provenance.jsonl", line.dump(-1, ' ', false, Json::error_handler_t::replace));
  WriteFileAtomic(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

CommandResult ResultOfCurrentException() {
  try {
    throw;
  } catch (const CancelledError& e) {
    return ErrorResult(ReceivedSignal() ? 128 + ReceivedSignal() : kExitInterrupted, "CLI-INTERRUPTED", e.what());
  } catch (const UsageError& e) {
    return ErrorResult(kExitUsage, "CLI-USAGE", e.what());
  } catch (const IoError& e) {
    return ErrorResult(kExitBadInput, "INPUT-IO", e.what());
  } catch (const FormatError& e) {
    return ErrorResult(kExitBadInput, "INPUT-FORMAT", e.what());
  } catch (const ResourceError& e) {
    return ErrorResult(kExitResources, "RESOURCES", e.what());
  } catch (const std::bad_alloc&) {
    return ErrorResult(kExitResources, "RESOURCES", "out of memory", "use fewer threads, smaller images or fewer frames");
  } catch (const MissingToolError& e) {
    return ErrorResult(kExitMissingTool, "MISSING-TOOL", e.what());
  } catch (const fs::filesystem_error& e) {  // a path that cannot even be looked at: a loop of links, a name too long, no right
    const bool full = e.code() == std::errc::no_space_on_device;
    return ErrorResult(full ? kExitResources : kExitBadInput, full ? "RESOURCES" : "INPUT-IO",
                       e.path1().string() + ": " + e.code().message());
  } catch (const std::exception& e) {
    return ErrorResult(kExitInternal, "INTERNAL", e.what(),
                       "this is a defect of mvstudio: please report it with the command line");
  }
}

}  // namespace mvstudio::cli
