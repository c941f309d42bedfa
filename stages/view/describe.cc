#include "stages/view/describe.h"

namespace mvstudio::stages {

CommandResult Describe(const ViewReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.partial = false;  // what was left out is named; whoever looked has looked
  const Scene& scene = report.scene;
  result.metrics = {{"kind", scene.kind},
                    {"num_cameras", scene.cameras.size()},
                    {"num_time_steps", scene.steps.size()},
                    {"has_report", report.has_report},
                    {"num_images_sent", report.num_images}};
  if (scene.kind == "messages") {
    result.text = "Shown in Rerun's viewer: " + report.options.scene.path;
    return result;
  }
  result.text = "Shown: " + report.options.scene.path + ", " + std::to_string(scene.cameras.size()) + " cameras, " +
                std::to_string(scene.steps.size()) + " time steps";
  return result;
}

}  // namespace mvstudio::stages
