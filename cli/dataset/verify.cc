#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset/dataset_report.h"
#include "stages/dataset_verify/run.h"

namespace mvstudio::cli {
namespace {

struct VerifyArguments {
  std::string folder;
  stages::DatasetVerifyKept kept;
  dataset::VerifyOptions options;
};

}  // namespace

void RegisterDatasetVerify(CLI::App& dataset, Registry& registry) {
  auto arguments = std::make_shared<VerifyArguments>();
  CLI::App* verify = dataset.add_subcommand(
      "verify", "List everything that is wrong with a dataset folder or a pack; exit 6 when parts are bad, 3 when all is");
  AddOption(verify, "folder", arguments->folder, "folder in Panoptic layout, or a pack (folder of shards, .h5 file)")
      ->required();
  AddOutput(verify, "--keep", arguments->kept.folder, OutputKind::kFolder,
            "folder that keeps the findings for the report; the dataset itself is only read");
  AddOptions(verify, arguments->options);
  OptionAdder adder{verify};
  adder("cache", arguments->kept.cache, "where checks of cameras are that others made by option 'part': a folder, or off");
  adder("part", arguments->kept.part, "share=K/N: check every N-th camera, keep that, and write a list alone");
  registry.Add(verify, "dataset verify", [arguments](CommandContext& context) {
    CommandResult result = stages::RunDatasetVerify(arguments->folder, arguments->options, arguments->kept, context.run);
    result.folder = arguments->kept.folder;
    return result;
  });

  auto folder = std::make_shared<std::string>();
  CLI::App* info = dataset.add_subcommand("info", "Describe a session, a dataset folder or a pack");
  AddOption(info, "folder", *folder, "session, folder in Panoptic layout, or a pack (folder of shards, .h5 file)")->required();
  registry.Add(info, "dataset info", [folder](CommandContext&) { return stages::DescribeDataset(*folder); });
}

}  // namespace mvstudio::cli
