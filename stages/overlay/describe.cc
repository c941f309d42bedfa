#include "stages/overlay/describe.h"

namespace mvstudio::stages {

CommandResult Describe(const OverlayReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.metrics = {{"num_cameras", report.num_cameras},
                    {"num_time_steps", report.num_steps},
                    {"num_images_missing", report.num_missing},
                    {"frame_rate_hz", report.rate_hz}};
  for (const auto& [path, role] : report.outputs) result.outputs.push_back({path, role});
  result.text = std::to_string(report.num_cameras) + " cameras, " + std::to_string(report.num_steps) +
                " time steps: " + report.options.out;
  return result;
}

}  // namespace mvstudio::stages
