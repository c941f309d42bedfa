#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/stage.h"
#include "stages/dataset/studio_names.h"
#include "stages/nets/trials/run.h"

namespace mvstudio::cli {

void RegisterTradeoffAvatar(CLI::App& tradeoff, Registry& registry) {
  const auto a = std::make_shared<stages::AvatarTradeoffOptions>();
  CLI::App* sub = tradeoff.add_subcommand("avatar",
                                          "Method x width or Gaussians x image size x steps x losses x cameras: held-out SSIM "
                                          "and FD, s a step, ms a frame, and the Pareto front");
  AddOption(sub, "dataset", a->dataset, "dataset folder, as for `avatar train`")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder,
            "folder of the runs, the table and the figures; finished runs in it are kept")
      ->required();
  AddOption(sub, "--methods", a->grid.methods, "of tna, direct, v2v, gaussians")->delimiter(',')->capture_default_str();
  AddOption(sub, "--gaussians", a->grid.gaussians, "Gaussians to begin with, in place of the width; 0: automatic")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--widths", a->grid.widths, "channels of the first layer")->delimiter(',')->capture_default_str();
  AddOption(sub, "--sizes", a->grid.sizes, "edge of the crops, px")->delimiter(',')->capture_default_str();
  AddOption(sub, "--steps", a->grid.steps, "end-to-end steps; 0: the posed template in averaged colours, without a network")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--losses", a->grid.losses, "terms of l1, ssim, gradient, posenet joined by +; Gaussians have the first two")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--cameras", a->grid.cameras, "cameras trained on, as many as there are at most; spread out")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--holdout-cameras,--test-cameras", a->camera_words,
            "cameras scored and never trained on; every fifth unless given");
  AddOption(sub, "--holdout-frames,--test-frames", a->holdout_frames,
            "frames scored and never trained on; the last quarter unless given");
  AddOption(sub, "--score-size", a->score_size_px, "edge of the crops that are compared, px; 0: the largest of --sizes")
      ->capture_default_str();
  AddOption(sub, "--features", a->features, "net of the Frechet distance, as for `avatar eval`")->capture_default_str();
  AddOption(sub, "--train", a->train_flags, "further flags of every training of a network, e.g. \"--batch 4\"");
  AddOption(sub, "--train-gaussians", a->gaussian_flags,
            "further flags of every training of Gaussians, e.g. \"--colour-degree 0\"");
  AddOption(sub, "--limit-minutes", a->limit_minutes, "begin no further trial after them; 0: no limit")->capture_default_str();
  AddFlag(sub, "--quick", a->quick, "a grid of a few minutes: widths 8 16, 64 px, 0, 60 and 180 steps, all cameras and 3");
  registry.Add(sub, "tradeoff avatar", [a](CommandContext& context) {
    context.camera_names = stages::StudioNames(a->dataset);
    return Describe(RunAvatarTradeoff(*a, ChildCallsIn(context), context.run));
  });
}

}  // namespace mvstudio::cli
