#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/synth/describe.h"

namespace mvstudio::cli {

void RegisterSynth(CLI::App& app, Registry& registry) {
  const auto options = std::make_shared<stages::SynthSessionOptions>();
  CLI::App* sub = app.add_subcommand("synth", "Write a synthetic session with ground truth");
  AddOptions(sub, *options);
  sub->get_option("--out")->required();
  registry.Add(sub, "synth", [options](CommandContext& context) { return Describe(RunSynth(*options, context.run)); });
}

}  // namespace mvstudio::cli
