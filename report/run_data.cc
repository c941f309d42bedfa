#include "report/run_data.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "report/page/inside.h"

namespace mvstudio::report {
namespace fs = std::filesystem;
namespace {

constexpr int kMaxDepth = 4;
constexpr uintmax_t kMaxFileBytes = 256u << 20;

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

bool IsWanted(const std::string& name) {
  return EndsWith(name, ".result.json") || name == "calibration.json" || name == "points.csv" || name == "pose3d.json" ||
         name == "history.csv" || name == "provenance.jsonl";
}

std::vector<fs::path> WantedFiles(const fs::path& root, bool follow_links, std::vector<Notice>* warnings) {
  std::vector<fs::path> files;
  std::error_code code;
  fs::recursive_directory_iterator it(root, fs::directory_options::skip_permission_denied, code), end;
  if (code) throw IoError(root.string(), "cannot read the folder: " + code.message());
  while (it != end) {
    const std::string name = it->path().filename().string();
    std::error_code ignored;
    const bool folder = it->is_directory(ignored);
    if (folder && (name[0] == '.' || it.depth() >= kMaxDepth)) it.disable_recursion_pending();
    if (!folder && IsWanted(name)) {
      const std::string relative = it->path().lexically_relative(root).string();
      if (!follow_links && !InsideFolder(root.string(), relative)) {
        warnings->push_back(LeadsOut(relative));
      } else if (it->is_regular_file(ignored)) {
        files.push_back(it->path());
      }
    }
    it.increment(code);
    if (!code) continue;
    warnings->push_back(
        {"REP-FOLDER", root.string() + ": not read to its end: " + code.message(), "check the disk and the permissions"});
    break;
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string NormalCommand(const Value& result, const std::string& file) {
  std::string command = result["command"].Text();
  if (command.empty()) {
    command = fs::path(file).filename().string();
    command = command.substr(0, command.find(".result.json"));
  }
  std::replace(command.begin(), command.end(), '_', ' ');
  return command;
}

Verdict StatusVerdict(const Value& result) {
  const std::string status = result["status"].Text();
  if (status == "ok") return result["warnings"].items().empty() ? Verdict::kPass : Verdict::kWarn;
  if (status == "warn" || status == "partial") return Verdict::kWarn;
  if (status == "fail" || status == "error") return Verdict::kFail;
  const double exit = result["exit"].Number();
  return exit == 0 ? Verdict::kPass : Verdict::kFail;
}

/// A missed check that the command itself did not hold against the run is a warning.
Verdict StageVerdict(const Value& result) {
  Verdict verdict = StatusVerdict(result);
  for (const Value& check : result.Path("metrics.checks").items()) {
    if (check["pass"].kind() == Value::Kind::kBool && !check["pass"].Flag()) verdict = Worse(verdict, Verdict::kWarn);
  }
  return verdict;
}

bool IsGroundTruth(const std::string& relative) {
  for (const fs::path& part : fs::path(relative)) {
    if (part == "truth") return true;
  }
  return false;
}

/// Reads the files one by one; what goes wrong with one is a warning that names it.
class Reader {
 public:
  Reader(const fs::path& root, RunData* data) : root_(root), data_(data) {}

  void Read(const fs::path& path) {
    const std::string relative = fs::path(path).lexically_relative(root_).string();
    const std::string folder = fs::path(relative).parent_path().string(), name = path.filename().string();
    try {
      std::error_code ignored;
      if (fs::file_size(path, ignored) > kMaxFileBytes) throw FormatError(relative, "", "larger than 256 MB, left out");
      const std::string text = ReadFile(path.string());
      if (EndsWith(name, ".result.json")) {
        AddStage(relative, folder, text);
      } else if (name == "calibration.json") {
        AddCalibration(relative, folder, text);
      } else if (name == "provenance.jsonl") {
        AddProvenance(relative, folder, text);
      } else if (name == "pose3d.json") {
        data_->poses.push_back({relative, folder, Value::Parse(text, relative)});
      } else if (!IsGroundTruth(relative)) {
        (name == "points.csv" ? data_->points : data_->histories).push_back({relative, folder, ParseTable(text, relative)});
      }
    } catch (const Error& error) {
      Warn("REP-FILE", error.what(), "run the command that writes this file again");
    }
  }

 private:
  void Warn(const std::string& code, const std::string& text, const std::string& hint) {
    data_->warnings.push_back({code, text, hint});
  }

  void AddStage(const std::string& relative, const std::string& folder, const std::string& text) {
    Value result = Value::Parse(text, relative);
    if (!result.IsObject()) throw FormatError(relative, "", "not a result: an object was expected");
    const std::string schema = result["schema"].Text();
    if (schema.rfind("mvstudio.result/", 0) != 0) throw FormatError(relative, "schema", "not a result of mvstudio");
    if (schema != "mvstudio.result/1") {
      Warn("REP-SCHEMA", relative + ": schema '" + schema + "' is newer than this program",
           "update mvstudio; some numbers may be missing");
    }
    Stage stage{root_.string(), relative, folder, NormalCommand(result, relative), std::move(result), Verdict::kNotRun};
    if (stage.command == "report") return;
    stage.verdict = StageVerdict(stage.result);
    data_->stages.push_back(std::move(stage));
  }

  void AddCalibration(const std::string& relative, const std::string& folder, const std::string& text) {
    if (IsGroundTruth(relative)) return;
    Value value = Value::Parse(text, relative);
    if (!value["cameras"].IsArray()) throw FormatError(relative, "cameras", "no list of cameras");
    data_->calibrations.push_back({relative, folder, std::move(value)});
  }

  void AddProvenance(const std::string& relative, const std::string& folder, const std::string& text) {
    size_t number = 0;
    for (size_t begin = 0; begin < text.size();) {
      const size_t end = std::min(text.find('\n', begin), text.size());
      const std::string line = text.substr(begin, end - begin);
      begin = end + 1;
      ++number;
      if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
      try {
        data_->provenance.push_back({relative, folder, Value::Parse(line, relative)});
      } catch (const Error&) {
        Warn("REP-FILE", relative + ": line " + std::to_string(number) + " is not valid JSON, left out", "");
      }
    }
  }

  fs::path root_;
  RunData* data_;
};

/// "dataset build" of its words.
std::string CommandOf(const Value& words) {
  const std::string first = words.At(0).Text();
  const bool group = first == "avatar" || first == "calib" || first == "dataset" || first == "session";
  return group ? first + " " + words.At(1).Text() : first;
}

/// Stages that `run` saw fail before they had a place for a result: what run.json keeps of them.
void AddFailures(const fs::path& root, RunData* data) {
  constexpr const char* kFile = "run.json";
  std::error_code ignored;
  if (!InsideFolder(root.string(), kFile) || !fs::is_regular_file(root / kFile, ignored)) return;
  try {
    const Value record = Value::Parse(ReadFile((root / kFile).string()), kFile);
    if (record["schema"].Text() != "mvstudio.run/1") return;
    for (const Value& stage : record["stages"].items()) {
      const std::string command = CommandOf(stage["words"]);
      const std::vector<const Stage*> told = data->All(command);
      const bool known = std::any_of(told.begin(), told.end(), [](const Stage* s) { return s->verdict == Verdict::kFail; });
      if (known || stage["errors"].items().empty()) continue;
      Value result = Value::Object();
      result.Set("command", command).Set("status", "error").Set("exit", stage["exit"]).Set("errors", stage["errors"]);
      data->stages.push_back({root.string(), kFile, "", command, std::move(result), Verdict::kFail});
    }
  } catch (const Error& error) {
    data->warnings.push_back({"REP-FILE", error.what(), "run `mvstudio run` again"});
  }
}

int FolderDepth(const std::string& folder) {
  return static_cast<int>(std::distance(fs::path(folder).begin(), fs::path(folder).end()));
}

template <class File>
void ShallowFirst(std::vector<File>* files) {
  std::stable_sort(files->begin(), files->end(),
                   [](const File& a, const File& b) { return FolderDepth(a.folder) < FolderDepth(b.folder); });
}

}  // namespace

Notice LeadsOut(const std::string& what) {
  return {"REP-OUTSIDE", what + " leads out of the run's folder, and is not read",
          "copy what belongs to the run into its folder, or pass option 'follow-links' for a run that you trust"};
}

int PipelineOrder(const std::string& command) {
  static const char* const kOrder[] = {"synth",         "dataset import",   "session init",  "session show",  "doctor",
                                       "calib convert", "calibrate",        "calib refine",  "calib compare", "calib eval",
                                       "sync",          "session timeline", "pose2d",        "triangulate",   "mask",
                                       "dataset build", "dataset verify",   "dataset split", "dataset pack",  "dataset export",
                                       "avatar train",  "avatar resume",    "avatar eval",   "metrics",       "demo"};
  const auto found = std::find(std::begin(kOrder), std::end(kOrder), command);
  return static_cast<int>(found - std::begin(kOrder));
}

std::vector<const Stage*> RunData::All(const std::string& command) const {
  std::vector<const Stage*> found;
  for (const Stage& stage : stages) {
    if (stage.command == command) found.push_back(&stage);
  }
  return found;
}

RunData ScanRun(const std::string& folder, bool follow_links) {
  RunData data;
  data.root = folder;
  RequireFolder(folder, "; give the option 'out' folder of an earlier command");
  const fs::path root(folder);
  Reader reader(root, &data);
  for (const fs::path& path : WantedFiles(root, follow_links, &data.warnings)) reader.Read(path);
  AddFailures(root, &data);
  std::stable_sort(data.stages.begin(), data.stages.end(),
                   [](const Stage& a, const Stage& b) { return PipelineOrder(a.command) < PipelineOrder(b.command); });
  std::stable_sort(data.provenance.begin(), data.provenance.end(),
                   [](const JsonFile& a, const JsonFile& b) { return a.value["time"].Text() < b.value["time"].Text(); });
  ShallowFirst(&data.calibrations);
  ShallowFirst(&data.points);
  if (data.stages.empty() && data.calibrations.empty() && data.points.empty() && data.histories.empty() &&
      data.provenance.empty()) {
    const std::string broken = data.warnings.empty() ? "" : " (" + data.warnings.front().text + ")";
    throw IoError(folder,
                  "nothing to report here" + broken +
                      "; expected *.result.json, calibration.json, points.csv or history.csv as the other commands write them");
  }
  return data;
}

std::string FileOfRun(const Stage& stage, const std::string& path, bool follow_links) {
  std::error_code ignored;
  const auto file = follow_links ? (fs::path(stage.root) / path).string() : InsideFolder(stage.root, path);
  return file && fs::is_regular_file(*file, ignored) ? *file : "";
}

OutputPlace ResolveOutput(const Stage& stage, const std::string& path, bool follow_links) {
  const fs::path given(path), own = stage.folder;
  std::vector<fs::path> candidates = {own / given, given};  // relative to the run
  std::error_code ignored;
  if (given.is_relative()) candidates.push_back(fs::absolute(given, ignored));  // as the command was told
  candidates.push_back(own / given.filename());
  // A run folder that was moved: the tail of the path still holds below it.
  fs::path tail;
  std::vector<fs::path> parts(given.begin(), given.end());
  for (size_t i = parts.size(); i-- > 1;) {
    tail = tail.empty() ? parts[i] : parts[i] / tail;
    candidates.push_back(tail);
    candidates.push_back(own / tail);
  }
  for (const fs::path& candidate : candidates) {
    const std::string file = FileOfRun(stage, candidate.string(), follow_links);
    if (!file.empty()) return {file, false};
  }
  return {"", !follow_links && !InsideFolder(stage.root, candidates[0].string())};
}

}  // namespace mvstudio::report
