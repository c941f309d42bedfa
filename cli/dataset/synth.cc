#include <chrono>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/format.h"
#include "synth/session.h"

namespace mvstudio::cli {
namespace {

struct SynthFlags {
  std::string out;
  bool overwrite = false;
  synth::SynthOptions options;
};

CommandResult Refusal(const synth::SynthSummary& summary) {
  CommandResult result;
  result.exit = kExitIllPosed;
  result.errors.push_back({"SYN-CLOTH",
                           "the cloth gave no surface in frame " + std::to_string(summary.failed_frame) + " (" +
                               std::string(ToString(summary.status)) + "); nothing was written",
                           "take another seed or body, or --subject skinned"});
  return result;
}

/// mm beyond linear blend skinning, by mesh.
nlohmann::ordered_json ToJson(const std::vector<synth::BeyondSkinning>& meshes) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const synth::BeyondSkinning& mesh : meshes) json[mesh.mesh] = {{"rms_mm", mesh.rms_mm}, {"max_mm", mesh.max_mm}};
  return json;
}

CommandResult RunSynth(const SynthFlags& flags, CommandContext& context) {
  const auto start = std::chrono::steady_clock::now();
  const synth::SynthSummary summary = synth::WriteSession(flags.options, flags.out, flags.overwrite, context.run);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (summary.status != Status::kOk) return Refusal(summary);
  CommandResult result;
  result.folder = flags.out;
  if (!flags.options.body.empty()) result.inputs = {flags.options.body};
  result.metrics["cameras"] = summary.cameras;
  result.metrics["frames"] = summary.frames;
  result.metrics["wall_s"] = wall_s;
  result.metrics["px_per_s"] = static_cast<double>(summary.pixels) / wall_s;
  if (!summary.beyond_skinning.empty()) result.metrics["beyond_skinning"] = ToJson(summary.beyond_skinning);
  for (const std::string& file : summary.files) result.outputs.push_back({flags.out + "/" + file, ""});
  result.text = "session with " + std::to_string(summary.cameras) + " cameras and " + std::to_string(summary.frames) +
                " frames each in " + flags.out + "\n";
  for (const synth::BeyondSkinning& mesh : summary.beyond_skinning) {
    result.text += Format("%-6s %5.1f mm rms, %5.1f mm at most beyond linear blend skinning\n", mesh.mesh.c_str(), mesh.rms_mm,
                          mesh.max_mm);
  }
  return result;
}

}  // namespace

void RegisterSynth(CLI::App& app, Registry& registry) {
  CLI::App* sub = app.add_subcommand("synth", "Write a synthetic session with ground truth");
  auto flags = std::make_shared<SynthFlags>();
  AddOutput(sub, "--out", flags->out, OutputKind::kFolder, "session folder to write")->required();
  AddFlag(sub, "--overwrite", flags->overwrite, "replace an existing session");
  AddOptions(sub, flags->options);
  registry.Add(sub, "synth", [flags](CommandContext& context) { return RunSynth(*flags, context); });
}

}  // namespace mvstudio::cli
