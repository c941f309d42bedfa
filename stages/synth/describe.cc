#include "stages/synth/describe.h"

#include "core/format.h"

namespace mvstudio::stages {
namespace {

CommandResult Refusal(const synth::SynthSummary& summary) {
  CommandResult result;
  result.exit = kExitIllPosed;
  result.errors.push_back({"SYN-CLOTH",
                           "the cloth gave no surface in frame " + std::to_string(summary.failed_frame) + " (" +
                               std::string(ToString(summary.status)) + "); nothing was written",
                           "take another seed or body, or option 'subject' skinned"});
  return result;
}

/// mm beyond linear blend skinning, by mesh.
nlohmann::ordered_json MeshesJson(const std::vector<synth::BeyondSkinning>& meshes) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const synth::BeyondSkinning& mesh : meshes) json[mesh.mesh] = {{"rms_mm", mesh.rms_mm}, {"max_mm", mesh.max_mm}};
  return json;
}

}  // namespace

CommandResult Describe(const SynthReport& report) {
  const synth::SynthSummary& summary = report.summary;
  if (summary.status != Status::kOk) return Refusal(summary);
  const std::string& out = report.options.out;
  CommandResult result;
  result.folder = out;
  if (!report.options.studio.body.empty()) result.inputs = {report.options.studio.body};
  result.metrics["cameras"] = summary.cameras;
  result.metrics["frames"] = summary.frames;
  result.metrics["wall_s"] = report.wall_s;
  result.metrics["px_per_s"] = static_cast<double>(summary.pixels) / report.wall_s;
  if (!summary.beyond_skinning.empty()) result.metrics["beyond_skinning"] = MeshesJson(summary.beyond_skinning);
  for (const std::string& file : summary.files) result.outputs.push_back({out + "/" + file, ""});
  result.text = "session with " + std::to_string(summary.cameras) + " cameras and " + std::to_string(summary.frames) +
                " frames each in " + out + "\n";
  for (const synth::BeyondSkinning& mesh : summary.beyond_skinning) {
    result.text += Format("%-6s %5.1f mm rms, %5.1f mm at most beyond linear blend skinning\n", mesh.mesh.c_str(), mesh.rms_mm,
                          mesh.max_mm);
  }
  return result;
}

}  // namespace mvstudio::stages
