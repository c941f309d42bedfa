#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset_build/describe.h"

namespace mvstudio::cli {
namespace {

void RegisterBuild(CLI::App* dataset, Registry& registry) {
  auto options = std::make_shared<stages::DatasetBuildOptions>();
  CLI::App* sub =
      dataset->add_subcommand("build", "Footage, calibration and 3D joints -> dataset in CMU Panoptic layout, with masks");
  AddOptions(sub, *options);
  sub->get_option("--masks")->expected(0, 1)->type_name("DIR");
  registry.Add(sub, "dataset build", [options, sub](CommandContext& context) {
    options->keep_sequence = sub->count("--sequence") > 0, options->keep_rate = sub->count("--frame-rate") > 0;
    options->make_masks = sub->count("--masks") > 0;
    return options->part.empty() ? Describe(stages::RunDatasetBuild(*options, context.run))
                                 : Describe(stages::RunDatasetBuildPart(*options, context.run));
  });
}

}  // namespace

void RegisterDataset(CLI::App& app, Registry& registry) {
  CLI::App* dataset = app.add_subcommand("dataset", "Build, check and describe datasets in CMU Panoptic layout");
  dataset->require_subcommand(1);
  RegisterBuild(dataset, registry);
  RegisterDatasetImport(*dataset, registry);
  RegisterDatasetPack(*dataset, registry);
  RegisterDatasetSplit(*dataset, registry);
  RegisterDatasetExport(*dataset, registry);
  RegisterDatasetVerify(*dataset, registry);
}

}  // namespace mvstudio::cli
