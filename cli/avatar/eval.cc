#include <chrono>
#include <cmath>

#include "avatar/run/evaluate/evaluate.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/format.h"
#include "stages/dataset/studio_names.h"

namespace mvstudio::cli {
namespace {

struct AvatarEvalArguments {
  std::string run_folder;
  avatar::EvaluateOptions options;
};

double Now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

void AddWarnings(const avatar::Evaluation& e, CommandResult* result) {
  if (!e.skipped.empty()) {
    result->exit = kExitPartial;
    result->warnings.push_back(
        {"AVA-SKIPPED",
         std::to_string(e.skipped.size()) + " held-out images could not be scored; the first: " + e.skipped.front(),
         "check those masks and joints, or leave these cameras or frames out"});
  }
  if (e.missing.missing() > 0)
    result->warnings.push_back(
        {"AVA-MISSING", "not scored: " + dataset::MissingText(e.missing), dataset::MissingHint(e.missing)});
  if (e.holdout_kind != "held-out cameras in held-out frames") {
    result->warnings.push_back({"AVA-HALF-HOLDOUT",
                                "scored on " + e.holdout_kind + ": only one of cameras and frames was held out",
                                "train with both --holdout-cameras and --holdout-frames"});
  }
  const metrics::RegionScore &own = e.holdout.mean.bbox, &mean = e.mean_image.mean.bbox, &pose = e.nearest_pose.mean.bbox;
  const auto below = [&](const std::string& name, const metrics::RegionScore& baseline) {
    if (own.ssim > baseline.ssim && own.psnr_db > baseline.psnr_db) return;
    result->warnings.push_back({"AVA-BELOW-BASELINE",
                                "the avatar does not beat the baseline '" + name + "' in both SSIM and PSNR",
                                "train longer (--steps), larger (--width), or with more cameras"});
  };
  below("mean image", mean);
  below("nearest pose", pose);
  const auto no_gain = [&](const std::string& trained, const avatar::Scored& without, const std::string& what,
                           const std::string& advice) {
    if (e.checkpoint_step == 0 || without.mean.bbox.ssim < own.ssim) return;
    result->warnings.push_back({"AVA-NO-GAIN",
                                trained + " not improve held-out images: " +
                                    Format("SSIM %.4f against %.4f of ", own.ssim, without.mean.bbox.ssim) + what,
                                advice});
  };
  if (e.template_alone) {
    no_gain("the network does", *e.template_alone, "its textures on the posed template alone",
            "train with --steps 0 (no network), or with more cameras or better joints");
  } else if (e.body_alone) {
    no_gain("the training does", *e.body_alone, "the fitted body in its averaged colours",
            "train longer (--steps), or with more cameras or better joints");
  }
  if (e.features.name.find("inception-2015-12-05") != std::string::npos && e.distance_name != "FID") {
    result->warnings.push_back(
        {"AVA-NOT-FID",
         e.features.name + " is not the published file (SHA-256 " + e.features.sha256 + "): the distance is not an FID",
         "fetch the file again; StyleGAN and clean-fid use the same one"});
  }
  if (!e.holdout.fd) {
    result->warnings.push_back(
        {"AVA-NO-FD", "no Frechet distance: it needs at least 4 held-out images of at least 32 px", "hold more frames out"});
  }
}

CommandResult RunAvatarEval(const AvatarEvalArguments& arguments, CommandContext& context) {
  context.camera_names = stages::StudioNames(avatar::OpenRun(arguments.run_folder, arguments.options.dataset).dataset);
  const avatar::Evaluation evaluation = avatar::Evaluate(arguments.run_folder, arguments.options, context.run, Now);
  CommandResult result;
  result.folder = arguments.run_folder;
  result.inputs = {arguments.run_folder, evaluation.config.dataset};
  result.metrics = nlohmann::ordered_json::parse(avatar::ToJsonText(evaluation));
  result.outputs.push_back({arguments.run_folder + "/" + avatar::kProtocolFile, "protocol"});
  for (const avatar::PictureStrip& strip : evaluation.strips) result.outputs.push_back({strip.path, "heldout-picture"});
  result.text = avatar::ToTable(evaluation);
  AddWarnings(evaluation, &result);
  return result;
}

}  // namespace

void RegisterAvatarEval(CLI::App& avatar, Registry& registry) {
  auto arguments = std::make_shared<AvatarEvalArguments>();
  CLI::App* sub =
      avatar.add_subcommand("eval", "Score a trained avatar on the cameras and frames it never saw, beside simple baselines");
  AddOutput(sub, "run", arguments->run_folder, OutputKind::kFolder, "folder of the training run (--out of `avatar train`)")
      ->required();
  AddOptions(sub, arguments->options);
  registry.Add(sub, "avatar eval", [arguments](CommandContext& context) { return RunAvatarEval(*arguments, context); });
}

}  // namespace mvstudio::cli
