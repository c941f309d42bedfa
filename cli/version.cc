#include "cli/program/commands.h"
#include "cli/program/options.h"

namespace mvstudio::cli {

void RegisterVersion(CLI::App& app, Registry& registry) {
  CLI::App* sub = app.add_subcommand("version", "Print the version");
  registry.Add(sub, "version", [](CommandContext&) {
    CommandResult result;
    result.metrics["version"] = MVSTUDIO_VERSION;
    result.metrics["avatar"] = MVSTUDIO_HAS_AVATAR != 0;
    result.text = std::string("mvstudio ") + MVSTUDIO_VERSION;
    return result;
  });
}

}  // namespace mvstudio::cli
