#include "avatar/nets/model.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/error.h"
#include "stages/nets/avatar_run.h"

namespace mvstudio::cli {
namespace {

CommandResult RunInfo(const std::string& run, const avatar::ModelOptions& asked) {
  if (!run.empty() && avatar::HoldsGaussians(run))
    throw UsageError(run + " holds Gaussians, not a network: their number is in avatar_train.result.json");
  CommandResult result;
  avatar::ModelOptions options = asked;
  if (!run.empty()) {
    const std::string checkpoint = stages::AvatarRun(run).checkpoint_path();
    avatar::RequireCheckpoint(checkpoint);
    const avatar::AvatarModel model = avatar::LoadModel(checkpoint);
    options = model.options;
    result.metrics["steps"] = model.step;
    result.metrics["size_px"] = model.size_px;
    result.inputs = {run};
  }
  Validate(options);
  const int channels = options.method == avatar::Method::kTna  ? 3
                       : options.method == avatar::Method::kHf ? options.neural_channels
                                                               : 0;
  const int64_t texels = int64_t{24} * channels * options.texture_px * options.texture_px;
  result.metrics["num_parameters"] = avatar::NumParameters(options);
  result.metrics["num_texels"] = texels;
  for (const auto& [name, value] : FieldsAsText(options)) result.metrics["model"][name] = value;
  result.text = "network: " + std::to_string(result.metrics["num_parameters"].get<int64_t>()) +
                " parameters; textures: " + std::to_string(texels) + " numbers\n";
  return result;
}

}  // namespace

void RegisterAvatarInfo(CLI::App& avatar, Registry& registry) {
  auto options = std::make_shared<avatar::ModelOptions>(avatar::PaperModel());
  auto run = std::make_shared<std::string>();
  CLI::App* info = avatar.add_subcommand("info", "Size of a network (defaults: the published one) or of a trained run");
  AddOption(info, "run", *run, "folder of a run; without it the options below are used");
  AddOptions(info, *options);
  registry.Add(info, "avatar info", [run, options](CommandContext&) { return RunInfo(*run, *options); });
}

}  // namespace mvstudio::cli
