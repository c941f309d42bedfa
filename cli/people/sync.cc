#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/sync/describe.h"

namespace mvstudio::cli {

void RegisterSync(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::SyncOptions>();
  CLI::App* sub =
      app.add_subcommand("sync", "Time offsets of the cameras: from people who move in the take, or from time stamps");
  VisitFields(OptionAdder{sub}, *options);  // --overwrite joins the last subject
  registry.Add(sub, "sync", [options, sub](CommandContext& context) {
    options->keep_range = GivenOptions(sub).count("max-offset-frames") > 0;
    return Describe(stages::RunSync(*options, context.run));
  });
}

}  // namespace mvstudio::cli
