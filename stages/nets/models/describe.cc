#include "stages/nets/models/describe.h"

#include <algorithm>

#include "core/format.h"

namespace mvstudio::stages {

CommandResult Describe(const ModelsReport& report) {
  const detect::ModelPackage& package = detect::PinnedModelPackage();
  CommandResult result;
  result.metrics["package"] = {
      {"name", package.name}, {"version", package.version}, {"integrity", package.integrity}, {"license", package.license}};
  if (!report.from.empty()) result.inputs.push_back(report.from);
  if (report.installed) {
    result.metrics["installed"] = report.installed->installed;
    result.outputs.push_back({report.installed->folder, "models"});
    result.text =
        report.installed->installed.empty() ? "everything is there\n" : "installed in " + report.installed->folder + "\n";
  }
  nlohmann::ordered_json& rows = result.metrics["models"] = nlohmann::ordered_json::array();
  for (const detect::ModelState& model : report.models) {
    const std::string state = model.defect.empty() ? "ok" : model.defect;
    rows.push_back({{"name", model.name}, {"state", state}, {"bytes", model.bytes}, {"path", model.path}});
    result.text += Format("%-16s %9zu bytes  ", model.name.c_str(), model.bytes) +
                   (model.defect.empty() ? model.path : model.defect) + "\n";
  }
  const bool sound = std::all_of(report.models.begin(), report.models.end(),
                                 [](const detect::ModelState& model) { return model.defect.empty(); });
  if (report.installed || sound) return result;
  result.exit = kExitMissingTool;
  result.errors.push_back({"MODELS-MISSING", "not all nets are installed and sound", "run `mvstudio models fetch`"});
  return result;
}

}  // namespace mvstudio::stages
