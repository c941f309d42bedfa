#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset_pack/describe.h"

namespace mvstudio::cli {

void RegisterDatasetPack(CLI::App& dataset, Registry& registry) {
  auto options = std::make_shared<stages::DatasetPackOptions>();
  CLI::App* sub = dataset.add_subcommand(
      "pack", "Dataset -> HDF5 shards of crops or whole images with cameras, masks and joints, for training and archive");
  StartGroup(sub, "Pack");
  AddOption(sub, "dataset", options->dataset, "dataset folder in Panoptic layout");
  VisitFields(OptionAdder{sub}, *options);
  sub->get_option("--out")->required();
  registry.Add(sub, "dataset pack",
               [options](CommandContext& context) { return Describe(stages::RunDatasetPack(*options, context.run)); });
}

}  // namespace mvstudio::cli
