// Private: pybind11's types.
#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "core/progress.h"
#include "python/fields.h"
#include "stages/result.h"

/// Stages as functions of Python.
namespace mvstudio::python {

struct Stage {
  std::string name;                   ///< in Python: "calib_convert"
  std::string command;                ///< of the program: "calib convert"
  std::string title;                  ///< one sentence
  std::vector<std::string> required;  ///< arguments without a default
  std::function<py::list()> fields;   ///< see FieldLister
  /// Takes the arguments; the function that it returns does without Python.
  std::function<std::function<stages::CommandResult(const RunContext&)>(const py::dict&)> prepare;
};

struct StageNames {
  std::string name, command, title;
  std::vector<std::string> required = {};
};

void RequireNoneLeft(const std::string& stage, const py::dict& left);

/// `visit(visitor, options)` visits all that is given; `run(options, given, context)` returns a CommandResult.
template <class Options, class Visit, class Run>
Stage MakeStage(const StageNames& names, Visit visit, Run run) {
  Stage stage{names.name, names.command, names.title, names.required, {}, {}};
  stage.fields = [visit] {
    py::list fields;
    FieldLister lister(&fields);
    Options options;
    visit(lister, options);
    return fields;
  };
  stage.prepare = [visit, run, name = names.name](const py::dict& arguments) {
    FieldSetter setter(arguments);
    Options options;
    visit(setter, options);
    RequireNoneLeft(name, setter.left());
    return [options, given = setter.given(), run](const RunContext& context) { return run(options, given, context); };
  };
  return stage;
}

void AddCalibrationStages(std::vector<Stage>* stages);
void AddPeopleStages(std::vector<Stage>* stages);
void AddDatasetStages(std::vector<Stage>* stages);
void AddPageStages(std::vector<Stage>* stages);

}  // namespace mvstudio::python
