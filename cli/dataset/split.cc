#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset_split/describe.h"

namespace mvstudio::cli {

void RegisterDatasetSplit(CLI::App& dataset, Registry& registry) {
  auto options = std::make_shared<stages::DatasetSplitOptions>();
  CLI::App* sub = dataset.add_subcommand("split",
                                         "Choose cameras and frames for training and test that share neither, write them to a "
                                         "file, and measure how far the test is from the training");
  AddOption(sub, "folder", options->dataset, "dataset folder")->required();
  AddOptions(sub, *options);
  registry.Add(sub, "dataset split",
               [options](CommandContext& context) { return Describe(stages::RunDatasetSplit(*options, context.run)); });
}

}  // namespace mvstudio::cli
