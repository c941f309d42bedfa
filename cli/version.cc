#include <array>
#include <memory>
#include <utility>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/format.h"

namespace mvstudio::cli {
namespace {

/// What later versions read: docs/stability.md, which a test holds against this list and the sources.
constexpr std::array<std::pair<const char*, const char*>, 20> kLasting = {{
    {"mvstudio.avatar-protocol/1", "protocol.json"},
    {"mvstudio.avatar-run/1", "config.json"},
    {"mvstudio.avatar/1", "checkpoint.safetensors"},
    {"mvstudio.avatar_references/1", "references.safetensors"},
    {"mvstudio.body/1", "body.npz"},
    {"mvstudio.calibration/1", "calibration.json"},
    {"mvstudio.dataset/1", "dataset.json"},
    {"mvstudio.export/1", "export.json"},
    {"mvstudio.gaussians/1", "gaussians.npz"},
    {"mvstudio.lifter/1", "NAME.safetensors"},
    {"mvstudio.pack-index/1", "INDEX.json"},
    {"mvstudio.pack-shard/1", "shard-NNNNN.done.json"},
    {"mvstudio.pack/1", "shard-NNNNN.h5"},
    {"mvstudio.pose3d/1", "pose3d.json"},
    {"mvstudio.result/1", "COMMAND.result.json"},
    {"mvstudio.session/1", "mvstudio.toml"},
    {"mvstudio.split/1", "split.json"},
    {"mvstudio.sync/1", "sync.json"},
    {"mvstudio.sync/2", "sync.json"},
    {"mvstudio.timeline/1", "TAKE.timeline.json"},
}};

}  // namespace

void RegisterVersion(CLI::App& app, Registry& registry) {
  CLI::App* sub = app.add_subcommand("version", "Print the version");
  auto formats = std::make_shared<bool>(false);
  sub->add_flag("--formats", *formats, "list the formats that this version and all later ones read");
  registry.Add(sub, "version", [formats](CommandContext&) {
    CommandResult result;
    result.metrics["version"] = MVSTUDIO_VERSION;
    result.metrics["avatar"] = MVSTUDIO_HAS_AVATAR != 0;
    result.text = std::string("mvstudio ") + MVSTUDIO_VERSION;
    for (const auto& [schema, file] : kLasting) {
      if (!*formats) break;
      result.metrics["formats"].push_back({{"schema", schema}, {"file", file}});
      result.text += Format("\n%-28s %s", schema, file);
    }
    return result;
  });
}

}  // namespace mvstudio::cli
