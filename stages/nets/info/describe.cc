#include "stages/nets/info/describe.h"

namespace mvstudio::stages {

CommandResult Describe(const NetworkInfo& info) {
  CommandResult result;
  if (info.step) {
    result.metrics["steps"] = *info.step;
    result.metrics["size_px"] = info.size_px;
    result.inputs = {info.run};
  }
  result.metrics["num_parameters"] = info.num_parameters;
  result.metrics["num_texels"] = info.num_texels;
  for (const auto& [name, value] : FieldsAsText(info.model)) result.metrics["model"][name] = value;
  result.text = "network: " + std::to_string(info.num_parameters) +
                " parameters; textures: " + std::to_string(info.num_texels) + " numbers\n";
  return result;
}

}  // namespace mvstudio::stages
