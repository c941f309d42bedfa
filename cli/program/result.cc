#include "cli/program/result.h"

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <ctime>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <new>
#include <system_error>

#include "cli/program/interrupt.h"
#include "cli/program/redact.h"
#include "core/choice/frame_choice.h"
#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/temporary.h"
#include "core/error.h"
#include "stages/input/fingerprint.h"

namespace mvstudio::cli {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

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
    if (notice.fails) item["level"] = "fail";
    list.push_back(item);
  }
  return list;
}

std::vector<Notice> NoticesFrom(const Json& list) {
  std::vector<Notice> notices;
  for (const Json& item : list)
    notices.push_back({item.value("code", ""), item.value("text", ""), item.value("hint", ""), item.contains("level")});
  return notices;
}

double PeakRssMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

std::string UtcNow() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&now));
  return text;
}

/// Messages name the user's files: not the hidden ones that stand for them while they are written, and something at least.
std::string WithoutEmptyPath(const std::string& text) {
  return FinalNames(text.compare(0, 2, ": ") == 0 ? "a file or folder" + text : text);
}

CommandResult ErrorResult(int exit, const std::string& code, const std::string& text, const std::string& hint = {}) {
  CommandResult result;
  result.exit = exit;
  result.errors.push_back({code, WithoutEmptyPath(text), hint});
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
  Json json = {{"schema", "mvstudio.result/1"},
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
  if (!result.unchanged_since.empty()) json["unchanged_since"] = result.unchanged_since;
  return json;
}

CommandResult ResultFromJson(const Json& json, int exit) {
  CommandResult result;
  result.exit = exit;
  result.metrics = json.value("metrics", Json::object());
  for (const Json& item : json.value("outputs", Json::array()))
    result.outputs.push_back({item.value("path", ""), item.value("role", "")});
  result.warnings = NoticesFrom(json.value("warnings", Json::array()));
  result.errors = NoticesFrom(json.value("errors", Json::array()));
  return result;
}

namespace {

Json ProvenanceLine(const std::string& command, const CommandResult& result, const Json& json,
                    const std::vector<std::string>& argv, const Json& record) {
  Json line = {{"time", UtcNow()}, {"command", command}, {"version", MVSTUDIO_VERSION}, {"argv", argv}, {"exit", result.exit}};
  line["inputs"] = Json::array();
  line["outputs"] = Json::array();
  for (const std::string& input : result.inputs) line["inputs"].push_back(stages::FingerprintJson(input));
  for (const auto& output : result.outputs) line["outputs"].push_back(stages::FingerprintJson(output.path));
  line["wall_s"] = json["timing"]["wall_s"];
  if (!record.is_null()) line["record"] = record;
  return line;
}

/// A failure to record a result: the result itself stays what it is, but for a full disk, or where the record is all that there
/// is.
CommandResult Unrecorded(CommandResult result) {
  const CommandResult failure = ResultOfCurrentException();
  const Notice& why = failure.errors.front();
  if (failure.exit == kExitResources) {
    result.exit = kExitResources;
    result.errors.push_back({why.code, "the outputs are complete, but not the record of them: " + why.text, why.hint});
  } else if (result.outputs.empty()) {
    result.exit = failure.exit;
    result.errors.push_back(why);
  } else {
    result.warnings.push_back({"CLI-PROVENANCE", "the result is not recorded in its folder: " + why.text, why.hint});
  }
  return result;
}

CommandResult OutOfMemoryResult() {
  return ErrorResult(kExitResources, "RESOURCES", "out of memory", "use fewer threads, smaller images or fewer frames");
}

bool HoldsOneOf(const std::string& text, std::initializer_list<std::errc> codes, std::initializer_list<const char*> words) {
  return std::any_of(words.begin(), words.end(), [&](const char* word) { return text.find(word) != std::string::npos; }) ||
         std::any_of(codes.begin(), codes.end(),
                     [&](std::errc code) { return text.find(std::make_error_code(code).message()) != std::string::npos; });
}

/// libtorch and OpenCV have exceptions of their own for it; threads that cannot be started are short of it, too.
bool SaysOutOfMemory(const std::string& text) {
  return HoldsOneOf(text, {std::errc::not_enough_memory, std::errc::resource_unavailable_try_again},
                    {"can't allocate memory", "Insufficient memory", "not enough memory"});
}

/// Of a path that could not be used: no fault of the path where the system is short of something.
CommandResult PathResult(const std::string& text) {
  const bool short_of = HoldsOneOf(text,
                                   {std::errc::no_space_on_device, std::errc::not_enough_memory, std::errc::too_many_files_open,
                                    std::errc::too_many_files_open_in_system},
                                   {});
  return ErrorResult(short_of ? kExitResources : kExitBadInput, short_of ? "RESOURCES" : "INPUT-IO", text);
}

}  // namespace

std::string JsonText(const Json& json) { return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

CommandResult Kept(const std::string& command, CommandResult result, const Json& json, const std::vector<std::string>& argv,
                   const Json& record) {
  if (result.folder.empty()) return result;
  std::string name = command;
  std::replace(name.begin(), name.end(), ' ', '_');
  const size_t errors = result.errors.size();
  const auto keep = [&](const std::function<void()>& write) {
    try {
      write();
    } catch (...) {
      if (result.errors.size() == errors) result = Unrecorded(std::move(result));  // one error line tells it
    }
  };
  keep([&] {
    const Json line = RedactedJson(ProvenanceLine(command, result, json, argv, record));
    AppendLine(result.folder + "/provenance.jsonl", line.dump(-1, ' ', false, Json::error_handler_t::replace));
  });
  keep([&] { WriteFileAtomic(result.folder + "/" + name + ".result.json", JsonText(RedactedJson(json))); });
  return result;
}

CommandResult InterruptedResult(int signal, const std::string& text) {
  const int exit = signal == SIGUSR1 ? int{kExitTryAgain} : signal > 0 ? 128 + signal : int{kExitInterrupted};
  return ErrorResult(exit, "CLI-INTERRUPTED", text);
}

CommandResult ResultOfCurrentException() {
  try {
    throw;
  } catch (const CancelledError& e) {
    return InterruptedResult(ReceivedSignal(), e.what());
  } catch (const UsageError& e) {
    return ErrorResult(kExitUsage, "CLI-USAGE", e.what());
  } catch (const NothingLeftError& e) {
    return ErrorResult(kExitQualityGate, "CLI-FRAMES", e.what());
  } catch (const LockedError& e) {
    return ErrorResult(kExitTryAgain, "CLI-LOCKED", e.what());
  } catch (const IoError& e) {
    return PathResult(e.what());
  } catch (const FormatError& e) {
    return ErrorResult(kExitBadInput, "INPUT-FORMAT", e.what());
  } catch (const ResourceError& e) {
    return ErrorResult(kExitResources, "RESOURCES", e.what());
  } catch (const std::bad_alloc&) {
    return OutOfMemoryResult();
  } catch (const MissingToolError& e) {
    return ErrorResult(kExitMissingTool, "MISSING-TOOL", e.what());
  } catch (const fs::filesystem_error& e) {  // a path that cannot even be looked at: a loop of links, a name too long, no right
    return PathResult(e.path1().string() + ": " + e.code().message());
  } catch (const std::exception& e) {
    if (SaysOutOfMemory(e.what())) return OutOfMemoryResult();
    return ErrorResult(kExitInternal, "INTERNAL", e.what(),
                       "this is a defect of mvstudio: please report it with the command line");
  }
}

}  // namespace mvstudio::cli
