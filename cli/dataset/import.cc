#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset_import/describe.h"

namespace mvstudio::cli {

void RegisterDatasetImport(CLI::App& dataset, Registry& registry) {
  CLI::App* import = dataset.add_subcommand("import", "Turn another project's recordings into a session folder");
  import->require_subcommand(1);
  const auto options = std::make_shared<stages::DatasetImportOptions>();
  CLI::App* sub = import->add_subcommand(
      "panoptic", "A CMU Panoptic sequence, or a folder in its layout -> session with calibration, joints, footage and times");
  AddOption(sub, "folder", options->folder, "folder with calibration_<sequence>.json")->required();
  AddOptions(sub, *options);
  sub->get_option("--out")->required();
  registry.Add(sub, "dataset import panoptic",
               [options](CommandContext& context) { return Describe(stages::RunDatasetImport(*options, context.run)); });
}

}  // namespace mvstudio::cli
