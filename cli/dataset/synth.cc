#include <chrono>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "synth/session.h"

namespace mvstudio::cli {
namespace {

struct SynthFlags {
  std::string out;
  bool overwrite = false;
  synth::SynthOptions options;
};

CommandResult RunSynth(const SynthFlags& flags, CommandContext& context) {
  const auto start = std::chrono::steady_clock::now();
  const synth::SynthSummary summary = synth::WriteSession(flags.options, flags.out, flags.overwrite, context.run);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  CommandResult result;
  result.folder = flags.out;
  result.metrics["cameras"] = summary.cameras;
  result.metrics["frames"] = summary.frames;
  result.metrics["wall_s"] = wall_s;
  result.metrics["px_per_s"] = static_cast<double>(summary.pixels) / wall_s;
  for (const std::string& file : summary.files) result.outputs.push_back({flags.out + "/" + file, ""});
  result.text = "session with " + std::to_string(summary.cameras) + " cameras and " + std::to_string(summary.frames) +
                " frames each in " + flags.out + "\n";
  return result;
}

}  // namespace

void RegisterSynth(CLI::App& app, Registry& registry) {
  CLI::App* sub = app.add_subcommand("synth", "Write a synthetic session with ground truth");
  auto flags = std::make_shared<SynthFlags>();
  AddOption(sub, "--out", flags->out, "session folder to write")->required();
  AddFlag(sub, "--overwrite", flags->overwrite, "replace an existing session");
  AddOptions(sub, flags->options);
  registry.Add(sub, "synth", [flags](CommandContext& context) { return RunSynth(*flags, context); });
}

}  // namespace mvstudio::cli
