#include "stages/nets/train/describe.h"

#include <cmath>
#include <map>
#include <sstream>

#include "core/format.h"
#include "stages/input/mask_notice.h"
#include "stages/nets/avatar_fit.h"

namespace mvstudio::stages {
namespace {

/// What the network was worth over the fitted body that it began with.
CommandResult DescribeGain(const NetworkTrained& trained) {
  CommandResult result;
  const avatar::TrainReport& report = trained.report;
  if (!std::isfinite(report.gain)) return result;
  result.metrics["network"] = {{"gain_ssim", report.gain}, {"kept", !report.network_off}};
  result.text =
      Format("on the validation images the network adds %.4f of SSIM to the fitted body", report.gain) +
      (report.network_off ? Format(", less than %.4g: left out (option 'least-gain' 0 keeps it)\n", trained.least_gain) : "\n");
  return result;
}

CommandResult DescribeNetwork(const AvatarTrainReport& report) {
  const avatar::TrainReport& trained = report.network->report;
  CommandResult result;
  auto& m = result.metrics;
  m["method"] = ToString(report.method);
  m["steps"] = report.steps;
  if (report.steps > 0) m["num_parameters"] = report.num_parameters;
  if (trained.best_step >= 0) m["best_step"] = trained.best_step;
  m["ended_early"] = trained.ended_early;
  m["device"] = report.network->device;
  std::map<std::string, avatar::HistoryRow> last;
  for (const avatar::HistoryRow& row : trained.history) last[row.phase] = row;
  for (const auto& [phase, row] : last) {
    m["final"][phase]["step"] = row.step;
    for (size_t i = 0; i < row.values.size(); ++i) m["final"][phase][avatar::kLossColumns[i]] = row.values[i];
  }
  m["it_per_s"] = trained.steps_done > 0 ? static_cast<double>(trained.steps_done) / report.network->seconds : std::nan("");
  m["wall_s"] = report.wall_s;
  m["ranks"] = report.network->ranks;
  if (trained.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"AVA-NONFINITE", trained.message,
                             "look at these images; train again without them or with a smaller option 'learning-rate'"});
  }
  if (trained.ended_early) result.text = trained.message + "\n";
  result.Add(DescribeGain(*report.network));
  return result;
}

CommandResult DescribeSkipped(const splats::SkippedSplats& skipped) {
  CommandResult result;
  result.metrics["skipped"] = {
      {"degenerate", skipped.degenerate}, {"behind_camera", skipped.behind_camera}, {"not_finite", skipped.not_finite}};
  if (skipped.degenerate + skipped.behind_camera + skipped.not_finite > 0)
    result.text = Format("%lld Gaussians could not be shown in the last image (key skipped)\n",
                         static_cast<long long>(skipped.degenerate + skipped.behind_camera + skipped.not_finite));
  return result;
}

CommandResult DescribeGaussians(const AvatarTrainReport& report) {
  CommandResult result;
  const avatar::GaussianTraining& trained = *report.gaussians;
  const splats::TrainResult& learned = trained.result;
  auto& m = result.metrics;
  m["method"] = ToString(report.method), m["num_parameters"] = report.num_parameters, m["gaussians"] = learned.cloud.size();
  m["steps"] = report.steps, m["wall_s"] = report.wall_s;
  if (trained.trials.size() <= 1)  // else the time is that of several trainings
    m["it_per_s"] = FiniteOrNull(report.wall_s > 0 ? trained.options.steps / report.wall_s : std::nan(""));
  m["density"] = {{"cloned", learned.density.cloned}, {"split", learned.density.split}, {"pruned", learned.density.pruned}};
  m["mip_filter"] = trained.options.smooth;
  for (const avatar::DegreeTrial& trial : trained.trials)
    m["colour_degrees"].push_back(
        {{"degree", trial.degree}, {"validation_ssim", FiniteOrNull(trial.validation_ssim)}, {"gaussians", trial.gaussians}});
  m["colour_degree"] = trained.options.degree;
  result.text = "colours of degree " + std::to_string(trained.options.degree) + ": " + trained.reason + "\n";
  result.Add(DescribeSkipped(learned.skipped));
  if (learned.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back(
        {"AVA-NONFINITE", "the loss is not finite on " + learned.trouble, "look at these images; train again without them"});
  }
  return result;
}

std::string SummaryOf(const AvatarTrainReport& report) {
  std::ostringstream text;
  text << "avatar (" << ToString(report.method);
  if (report.steps != 0) text << ", " << report.num_parameters << " parameters";
  text << ") " << (report.steps == 0 ? "made of " : "trained on ") << report.images << " images of "
       << report.config.split.train_cameras.size() << " cameras";
  if (report.steps != 0) text << ": " << report.steps << " steps in " << std::llround(report.wall_s) << " s";
  text << ", " << std::llround(report.whole_s) << " s in all\n  " << report.folder << "\n";
  return text.str();
}

/// The images, and what the dataset does not hold of them; missing images alone are no failure.
CommandResult DescribeImages(const AvatarTrainReport& report) {
  CommandResult result;
  result.metrics["train"] = {{"cameras", report.config.split.train_cameras.size()},
                             {"frames", report.config.split.train_frames.size()},
                             {"images", report.images},
                             {"template_iou", report.config.template_iou}};
  const PackNotes& packs = report.packs;
  result.metrics["missing"] = nlohmann::ordered_json::parse(dataset::MissingToJsonText(packs.missing));
  result.metrics["frames_without_person"] = packs.frames_without_person;
  const auto warn = [&](const std::string& kind, const dataset::MissingImages& missing) {
    result.warnings.push_back({"AVA-MISSING", kind + ": " + dataset::MissingText(missing), dataset::MissingHint(missing)});
  };
  if (packs.missing.missing() > 0) warn("training", packs.missing);
  for (const auto& [kind, missing] : packs.missing_scored) warn(kind, missing);
  if (packs.skipped.empty()) return result;
  result.warnings.push_back(
      {"AVA-SKIPPED", std::to_string(packs.skipped.size()) + " images were left out; the first: " + packs.skipped.front(),
       "check these images, masks and joints"});
  result.partial = true;
  return result;
}

CommandResult DescribeStart(const AvatarTrainReport& report) {
  CommandResult result;
  if (const auto& start = report.start) {
    result.metrics["init_from"] = {{"run", start->run},
                                   {"method", ToString(start->method)},
                                   {"taken", start->taken},
                                   {"partly", start->partly},
                                   {"fresh", start->fresh}};
    result.text = "begun with " + std::to_string(start->taken.size()) + " layers of " + start->run + ", " +
                  std::to_string(start->partly.size()) + " taken in part and " + std::to_string(start->fresh.size()) +
                  " begun anew\n";
  }
  if (report.seen) result.warnings.push_back(*report.seen);
  if (report.body_alone)
    result.text +=
        "no network: textured networks have added less than 0.01 of SSIM to fitted bodies, and no validation images are there "
        "to show that this one adds more (option 'validate-camera' NAME trains and judges one, option 'steps' 600 trains "
        "one)\n";
  return result;
}

CommandResult DescribeResumed(const AvatarTrainReport& report) {
  CommandResult result;
  if (!report.resumed_from) return result;
  result.metrics["resumed_from"] = *report.resumed_from;
  if (report.steps == *report.resumed_from)
    result.warnings.push_back({"AVA-NOTHING-TO-DO",
                               "all " + std::to_string(*report.resumed_from) + " steps are done, or option 'patience' was over",
                               "ask for more with option 'steps' or option 'patience'"});
  return result;
}

}  // namespace

CommandResult Describe(const AvatarTrainReport& report) {
  CommandResult result;
  if (report.rank != 0) return result;
  result.folder = report.folder, result.inputs = {report.config.dataset}, result.outputs = report.outputs;
  result.text = SummaryOf(report);
  result.Add(report.network ? DescribeNetwork(report) : DescribeGaussians(report));
  result.Add(DescribeImages(report));
  result.Add(DescribeStart(report));
  result.Add(DescribeResumed(report));
  if (report.budget) result.Add(Describe(*report.budget));
  Append(report.conflicts, &result.warnings);
  if (report.fit) {
    result.metrics["body"] = ToJson(*report.fit);
    result.Add(JudgeFit(*report.fit));
  }
  Append(report.notes.warnings, &result.warnings);
  if (report.masks) result.Add(DescribeMaskMeaning(*report.masks, report.dataset + "/masks", result.text));
  return result;
}

}  // namespace mvstudio::stages
