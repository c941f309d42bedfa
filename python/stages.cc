#include <algorithm>
#include <mutex>

#include "core/disk/lock.h"
#include "core/disk/manifest.h"
#include "core/disk/replace.h"
#include "core/join.h"
#include "core/text/short_numbers.h"
#include "python/bindings.h"
#include "python/run.h"
#include "python/stage.h"

namespace mvstudio::python {
namespace {

const std::vector<Stage>& AllStages() {
  static const std::vector<Stage> kStages = [] {
    std::vector<Stage> stages;
    AddCalibrationStages(&stages), AddPeopleStages(&stages), AddDatasetStages(&stages);
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

nlohmann::ordered_json NoticesJson(const std::vector<Notice>& notices) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Notice& n : notices) list.push_back({{"code", n.code}, {"text", n.text}, {"hint", n.hint}, {"fails", n.fails}});
  return list;
}

std::string JsonOf(const stages::CommandResult& result) {
  nlohmann::ordered_json outputs = nlohmann::ordered_json::array();
  for (const auto& output : result.outputs) outputs.push_back({{"path", output.path}, {"role", output.role}});
  const bool partial = result.partial && result.exit == stages::kExitOk;
  return nlohmann::ordered_json{{"exit", partial ? stages::kExitPartial : result.exit},
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
                     int threads, uint64_t seed) {
  const Stage& stage = StageNamed(name);
  const auto work = stage.prepare(arguments);
  std::string json;
  RunWatched({progress, threads, seed}, [&](const RunContext& run) {
    const std::lock_guard<std::mutex> alone(one_stage);
    const std::pair<std::string, std::string> before = WriterName();
    SetWriterName(stage.command, MVSTUDIO_VERSION);
    const OutputLockScope until_done;
    const ReplaceScope replacing(overwrite);
    try {
      json = JsonOf(work(run));
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
  return name == "from" || name == "in" ? name + "_" : name;
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
