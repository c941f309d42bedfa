#include "stages/click/describe.h"

#include "core/format.h"

namespace mvstudio::stages {

CommandResult Describe(const ClickReport& report) {
  const ClickScene& scene = report.scene;
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (report.is_written) result.outputs.push_back({report.options.out, "clicks"});
  result.metrics["num_points"] = scene.names.size();
  result.metrics["num_clicks"] = scene.clicks.size();
  result.metrics["cameras"] = nlohmann::ordered_json::array();
  for (size_t c = 0; c < scene.cameras.size(); ++c) {
    const ClickFit fit = FitClicks(scene, static_cast<int>(c), report.options.resection);
    const std::string& name = scene.cameras[c].name;
    result.metrics["cameras"].push_back({{"name", name},
                                         {"status", std::string(ToString(fit.status))},
                                         {"num_clicks", fit.num_clicks},
                                         {"rms_px", FiniteOrNull(fit.rms_px)},
                                         {"leave_one_out_px", FiniteOrNull(fit.leave_one_out_px)}});
    result.text += Format("%-16s %d of %zu points", name.c_str(), fit.num_clicks, scene.names.size());
    result.text += fit.status == Status::kOk
                       ? Format(", rms %.2f px, left-out points %.2f px\n", fit.rms_px, fit.leave_one_out_px)
                       : ": " + fit.message + "\n";
    for (const int point : fit.rejected) {
      result.warnings.push_back({"CAL-CLICK",
                                 "camera " + name + ": point " + scene.names[static_cast<size_t>(point)] + " is off",
                                 "mark it again, or check its coordinates"});
    }
  }
  return result;
}

}  // namespace mvstudio::stages
