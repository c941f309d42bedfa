#include "stages/nets/evaluate/describe.h"

#include "core/format.h"

namespace mvstudio::stages {
namespace {

CommandResult JudgeScores(const avatar::Evaluation& e) {
  CommandResult result;
  if (!e.skipped.empty()) {
    result.exit = kExitPartial;
    result.warnings.push_back(
        {"AVA-SKIPPED",
         std::to_string(e.skipped.size()) + " held-out images could not be scored; the first: " + e.skipped.front(),
         "check those masks and joints, or leave these cameras or frames out"});
  }
  if (e.missing.missing() > 0)
    result.warnings.push_back(
        {"AVA-MISSING", "not scored: " + dataset::MissingText(e.missing), dataset::MissingHint(e.missing)});
  if (e.holdout_kind != "held-out cameras in held-out frames") {
    result.warnings.push_back({"AVA-HALF-HOLDOUT",
                               "scored on " + e.holdout_kind + ": only one of cameras and frames was held out",
                               "train with both option 'holdout-cameras' and option 'holdout-frames'"});
  }
  const metrics::RegionScore &own = e.holdout.mean.bbox, &mean = e.mean_image.mean.bbox, &pose = e.nearest_pose.mean.bbox;
  const auto below = [&](const std::string& name, const metrics::RegionScore& baseline) {
    if (own.ssim > baseline.ssim && own.psnr_db > baseline.psnr_db) return;
    result.warnings.push_back({"AVA-BELOW-BASELINE",
                               "the avatar does not beat the baseline '" + name + "' in both SSIM and PSNR",
                               "train longer (option 'steps'), larger (option 'width'), or with more cameras"});
  };
  below("mean image", mean);
  below("nearest pose", pose);
  const auto no_gain = [&](const std::string& trained, const avatar::Scored& without, const std::string& what,
                           const std::string& advice) {
    if (e.checkpoint_step == 0 || without.mean.bbox.ssim < own.ssim) return;
    result.warnings.push_back({"AVA-NO-GAIN",
                               trained + " not improve held-out images: " +
                                   Format("SSIM %.4f against %.4f of ", own.ssim, without.mean.bbox.ssim) + what,
                               advice});
  };
  if (e.template_alone) {
    no_gain("the network does", *e.template_alone, "its textures on the posed template alone",
            "train with option 'steps' 0 (no network), or with more cameras or better joints");
  } else if (e.body_alone) {
    no_gain("the training does", *e.body_alone, "the fitted body in its averaged colours",
            "train longer (option 'steps'), or with more cameras or better joints");
  }
  if (e.features.name.find("inception-2015-12-05") != std::string::npos && e.distance_name != "FID") {
    result.warnings.push_back(
        {"AVA-NOT-FID",
         e.features.name + " is not the published file (SHA-256 " + e.features.sha256 + "): the distance is not an FID",
         "fetch the file again; StyleGAN and clean-fid use the same one"});
  }
  if (!e.holdout.fd) {
    result.warnings.push_back(
        {"AVA-NO-FD", "no Frechet distance: it needs at least 4 held-out images of at least 32 px", "hold more frames out"});
  }
  return result;
}

}  // namespace

CommandResult Describe(const AvatarEvalReport& report) {
  const avatar::Evaluation& evaluation = report.evaluation;
  CommandResult result = JudgeScores(evaluation);
  result.folder = report.folder, result.inputs = {report.folder, evaluation.config.dataset};
  result.metrics = nlohmann::ordered_json::parse(avatar::ToJsonText(evaluation));
  result.outputs.push_back({report.folder + "/" + avatar::kProtocolFile, "protocol"});
  for (const avatar::ImageStrip& strip : evaluation.strips) result.outputs.push_back({strip.path, "heldout-picture"});
  result.text = avatar::ToTable(evaluation);
  return result;
}

}  // namespace mvstudio::stages
