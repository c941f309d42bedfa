#include <algorithm>
#include <mutex>
#include <regex>
#include <set>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/manifest.h"
#include "core/disk/replace.h"
#include "core/error.h"
#include "core/join.h"
#include "core/stopwatch.h"
#include "core/text/short_numbers.h"
#include "python/bindings.h"
#include "python/run.h"
#include "python/stage.h"

namespace mvstudio::python {
namespace {

const std::vector<Stage>& AllStages() {
  static const std::vector<Stage> kStages = [] {
    std::vector<Stage> stages;
    AddCalibrationStages(&stages), AddPeopleStages(&stages), AddDatasetStages(&stages), AddPageStages(&stages);
    return stages;
  }();
  return kStages;
}

const Stage& StageNamed(const std::string& name) {
  for (const Stage& stage : AllStages()) {
    if (stage.name == name) return stage;
  }
  throw UsageError("there is no stage '" + name + "'");
}

const char* StatusOf(const stages::CommandResult& result, int exit) {
  if (exit == stages::kExitOk) return result.warnings.empty() ? "ok" : "warn";
  return exit == stages::kExitQualityGate ? "fail" : exit == stages::kExitPartial ? "partial" : "error";
}

/// As the program leaves notices in its results: the hint where there is one, a level where the notice fails.
nlohmann::ordered_json KeptNotices(const std::vector<Notice>& notices) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Notice& n : notices) {
    nlohmann::ordered_json item = {{"code", n.code}, {"text", n.text}};
    if (!n.hint.empty()) item["hint"] = n.hint;
    if (n.fails) item["level"] = "fail";
    list.push_back(item);
  }
  return list;
}

nlohmann::ordered_json NoticesJson(const std::vector<Notice>& notices) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Notice& n : notices) list.push_back({{"code", n.code}, {"text", n.text}, {"hint", n.hint}, {"fails", n.fails}});
  return list;
}

/// Options are flags in what the program keeps: `option 'min-views'` is `--min-views`.
void NameFlags(nlohmann::ordered_json* value) {
  static const std::regex kOption("\\boption '([a-z0-9][a-z0-9-]*)'");
  if (value->is_string()) *value = ShortNumbers(std::regex_replace(value->get<std::string>(), kOption, "--$1"));
  if (!value->is_structured()) return;
  for (nlohmann::ordered_json& item : *value) NameFlags(&item);
}

int ExitOf(const stages::CommandResult& result) {
  return result.partial && result.exit == stages::kExitOk ? stages::kExitPartial : result.exit;
}

/// Leaves COMMAND.result.json (mvstudio.result/1) in the result's folder, as the program does, so that `mvstudio report` shows
/// it. `call`: how Python called the stage. A result that cannot be kept is a warning.
void KeepResult(const Stage& stage, const std::vector<std::string>& argv, double wall_s, stages::CommandResult* result) {
  if (result->folder.empty()) return;
  nlohmann::ordered_json outputs = nlohmann::ordered_json::array();
  for (const auto& output : result->outputs) {
    nlohmann::ordered_json item = {{"path", output.path}};
    if (!output.role.empty()) item["role"] = output.role;
    outputs.push_back(item);
  }
  const int exit = ExitOf(*result);
  nlohmann::ordered_json json = {{"schema", "mvstudio.result/1"},
                                 {"command", stage.command},
                                 {"version", MVSTUDIO_VERSION},
                                 {"status", StatusOf(*result, exit)},
                                 {"exit", exit},
                                 {"metrics", result->metrics},
                                 {"outputs", outputs},
                                 {"warnings", KeptNotices(result->warnings)},
                                 {"errors", KeptNotices(result->errors)},
                                 {"timing", {{"wall_s", wall_s}}},
                                 {"argv", argv}};
  for (const char* key : {"metrics", "warnings", "errors"}) NameFlags(&json[key]);
  std::string name = stage.command;
  std::replace(name.begin(), name.end(), ' ', '_');
  try {
    WriteFileAtomic(result->folder + "/" + name + ".result.json",
                    json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  } catch (const Error& why) {
    result->warnings.push_back({"CLI-PROVENANCE", std::string("the result is not recorded in its folder: ") + why.what(), ""});
  }
}

std::string JsonOf(const stages::CommandResult& result) {
  nlohmann::ordered_json outputs = nlohmann::ordered_json::array();
  for (const auto& output : result.outputs) outputs.push_back({{"path", output.path}, {"role", output.role}});
  return nlohmann::ordered_json{{"exit", ExitOf(result)},
                                {"metrics", result.metrics},
                                {"outputs", outputs},
                                {"inputs", result.inputs},
                                {"warnings", NoticesJson(result.warnings)},
                                {"errors", NoticesJson(result.errors)},
                                {"text", ShortNumbers(result.text)}}
      .dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

/// The scopes below belong to the process: one stage at a time.
std::mutex one_stage;

std::string RunStage(const std::string& name, const py::dict& arguments, bool overwrite, const py::object& progress,
                     int threads, uint64_t seed, const std::vector<std::string>& argv) {
  const Stage& stage = StageNamed(name);
  const auto work = stage.prepare(arguments);
  std::string json;
  RunWatched({progress, threads, seed}, [&](const RunContext& run) {
    const std::lock_guard<std::mutex> alone(one_stage);
    const std::pair<std::string, std::string> before = WriterName();
    SetWriterName(stage.command, MVSTUDIO_VERSION);
    const OutputLockScope until_done;
    const ReplaceScope replacing(overwrite);
    const Stopwatch watch;
    try {
      stages::CommandResult result = work(run);
      KeepResult(stage, argv, watch.Seconds(), &result);
      json = JsonOf(result);
    } catch (...) {
      SetWriterName(before.first, before.second);
      throw;
    }
    SetWriterName(before.first, before.second);
  });
  return json;
}

py::list ListStages() {
  py::list list;
  for (const Stage& stage : AllStages()) {
    py::dict one;
    one["name"] = stage.name, one["command"] = stage.command, one["title"] = stage.title;
    one["required"] = stage.required, one["fields"] = stage.fields();
    list.append(one);
  }
  return list;
}

}  // namespace

std::string ArgumentName(const std::string& field) {
  std::string name = field.substr(0, field.find(','));
  std::replace(name.begin(), name.end(), '-', '_');
  static const std::set<std::string> kKeywords = {"for", "from", "in", "with"};
  return kKeywords.count(name) ? name + "_" : name;
}

std::string TextOf(const py::handle& value) {
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  if (py::hasattr(value, "__fspath__")) return value.attr("__fspath__")().cast<std::string>();
  if (py::isinstance<py::bool_>(value) || !(py::isinstance<py::int_>(value) || py::isinstance<py::float_>(value)))
    throw py::cast_error();
  return py::str(value);
}

std::vector<std::string> TextsOf(const py::handle& value) {
  std::vector<std::string> texts;
  if (py::isinstance<py::dict>(value)) {
    for (const auto& [key, item] : py::reinterpret_borrow<py::dict>(value)) texts.push_back(TextOf(key) + "=" + TextOf(item));
  } else if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    for (const py::handle& item : value) texts.push_back(TextOf(item));
  } else {
    texts.push_back(TextOf(value));
  }
  return texts;
}

void RequireNoneLeft(const std::string& stage, const py::dict& left) {
  if (left.empty()) return;
  std::vector<std::string> names;
  for (const auto& [name, value] : left) names.push_back("'" + name.cast<std::string>() + "'");
  throw py::type_error(stage + "() got an unexpected keyword argument " + Join(names, ", "));
}

void BindStages(py::module_& module) {
  module.def("stages", ListStages);
  module.def("run_stage", RunStage);
}

}  // namespace mvstudio::python
