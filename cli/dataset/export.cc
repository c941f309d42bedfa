#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset_export/describe.h"

namespace mvstudio::cli {

void RegisterDatasetExport(CLI::App& dataset, Registry& registry) {
  const auto options = std::make_shared<stages::DatasetExportOptions>();
  CLI::App* sub = dataset.add_subcommand("export", "Write a dataset for the program that is to read it (docs/exports.md)");
  AddOption(sub, "folder", options->dataset, "dataset folder")->required();
  AddOptions(sub, *options);
  sub->get_option("--to")->required()->type_name("FORMAT");
  sub->get_option("--out")->required();
  sub->get_option("--cameras")->take_all();
  registry.Add(sub, "dataset export",
               [options](CommandContext& context) { return Describe(stages::RunDatasetExport(*options, context.run)); });
}

}  // namespace mvstudio::cli
