#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/error.h"
#include "stages/scores/describe.h"
#if MVSTUDIO_HAS_AVATAR
#include "stages/nets/metrics_distance.h"
#endif

namespace mvstudio::cli {
#if !MVSTUDIO_HAS_AVATAR
namespace {

stages::ScoresReport RunScores(const stages::ScoresOptions& options, const RunContext& run) {
  stages::RequireTwoSets(options);
  if (options.distance_only || !options.write_statistics.empty())
    throw MissingToolError("distances between sets need libtorch, which this build was made without");
  return stages::RunPairScores(options, run);
}

}  // namespace
#endif

void RegisterMetrics(CLI::App& app, Registry& registry) {
  const auto options = std::make_shared<stages::ScoresOptions>();
  CLI::App* sub = app.add_subcommand(
      "metrics", "SSIM, PSNR and Frechet distance of two folders of images or two images, or of two files of features");
  AddOption(sub, "reference", options->reference,
            "folder of images (or of a folder for each camera), an image, a .npy of (n, d) numbers, a .safetensors file with a "
            "tensor `features`, or statistics: an .npz of `mu` and `sigma`")
      ->required();
  AddOption(sub, "other", options->other, "the same file names, or features or statistics of the same net");
  AddOptions(sub, *options);
  registry.Add(sub, "metrics", [options](CommandContext& context) { return Describe(RunScores(*options, context.run)); });
}

}  // namespace mvstudio::cli
