#include "stages/nets/lift/describe.h"

#include <utility>

#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::stages {
namespace {

using avatar::LiftComparison;
using avatar::LiftScore;
using nlohmann::ordered_json;

ordered_json ScoreJson(const LiftScore& s) {
  return {{"frames", s.frames},
          {"mpjpe_mm", FiniteOrNull(s.mpjpe_mm)},
          {"scaled_mpjpe_mm", FiniteOrNull(s.scaled_mpjpe_mm)},
          {"procrustes_mpjpe_mm", FiniteOrNull(s.procrustes_mpjpe_mm)},
          {"root_mm", FiniteOrNull(s.root_mm)},
          {"acceleration_mm", FiniteOrNull(s.acceleration_mm)},
          {"true_acceleration_mm", FiniteOrNull(s.true_acceleration_mm)}};
}

std::string ScoreText(const std::string& name, const LiftScore& s) {
  return Format("  %-12s joints %.1f mm, after Procrustes %.1f mm, place %.0f mm, acceleration %.1f mm (true %.1f)\n",
                name.c_str(), s.mpjpe_mm, s.procrustes_mpjpe_mm, s.root_mm, s.acceleration_mm, s.true_acceleration_mm);
}

/// On the frames of `what`; its metrics are `holdout`.
CommandResult DescribeComparison(const LiftComparison& c, const std::string& what) {
  CommandResult result;
  result.metrics["holdout"] = {
      {"lifter", ScoreJson(c.lifter)}, {"mean_pose", ScoreJson(c.mean_pose)}, {"nearest_neighbour", ScoreJson(c.nearest)}};
  result.text =
      what + ":\n" + ScoreText("lifter", c.lifter) + ScoreText("mean pose", c.mean_pose) + ScoreText("nearest", c.nearest);
  if (c.lifter.mpjpe_mm < c.mean_pose.mpjpe_mm && c.lifter.mpjpe_mm < c.nearest.mpjpe_mm) return result;
  result.warnings.push_back({"LIFT-BELOW-BASELINE",
                             what + ": the lifter does not beat the mean pose and the nearest known pose",
                             "train longer (option 'steps') or with more motions"});
  return result;
}

CommandResult DescribeHoldout(const LiftTrainReport& report) {
  CommandResult result = DescribeComparison(report.holdout->all, "held-out frames");
  for (size_t i = 0; i < report.holdout->per_dataset.size(); ++i) {
    CommandResult one = DescribeComparison(report.holdout->per_dataset[i], report.datasets[i]);
    ordered_json& json = result.metrics["per_dataset"].emplace_back(ordered_json{{"dataset", report.datasets[i]}});
    json["holdout"] = std::exchange(one.metrics, ordered_json::object())["holdout"];
    result.Add(std::move(one));
  }
  return result;
}

CommandResult DescribeStatuses(const std::map<int, avatar::LiftedFrame>& frames) {
  CommandResult result;
  std::map<std::string, int> counts;
  std::vector<double> rms;
  std::string first;
  for (const auto& [number, frame] : frames) {
    ++counts[std::string(ToString(frame.status))];
    if (frame.status == Status::kOk) rms.push_back(frame.rms_px);
    if (frame.status != Status::kOk && first.empty()) {
      first = "frame " + std::to_string(number) + ": " + std::string(ToString(frame.status));
    }
  }
  result.metrics["frames"] = frames.size();
  result.metrics["lifted"] = rms.size();
  result.metrics["status_counts"] = counts;
  result.metrics["median_rms_px"] = FiniteOrNull(UpperMedian(rms));
  result.text = Format("%d of %d frames lifted\n", static_cast<int>(rms.size()), static_cast<int>(frames.size()));
  if (rms.size() == frames.size()) return result;
  const std::string text = std::to_string(frames.size() - rms.size()) + " of " + std::to_string(frames.size()) +
                           " frames could not be lifted; the first: " + first;
  const std::string hint = "TooFewViews: fewer than 6 joints of the 19 were seen; look at the 2D poses and option 'min-score'";
  result.exit = rms.empty() ? kExitIllPosed : kExitPartial;
  (rms.empty() ? result.errors : result.warnings).push_back({"LIFT-FRAMES", text, hint});
  return result;
}

}  // namespace

CommandResult Describe(const LiftTrainReport& report) {
  CommandResult result;
  const avatar::LiftReport& training = report.training;
  result.inputs = report.datasets;
  result.metrics = {
      {"people", report.people}, {"frames", report.frames}, {"steps", training.steps_done}, {"size_m", report.size_m}};
  result.metrics["losses"] = ordered_json::array();
  for (const auto& [step, loss] : training.losses) result.metrics["losses"].push_back({step, loss});
  result.text = Format("lifter: %d steps on %d poses of %d people\n", training.steps_done, report.frames, report.people);
  if (report.holdout) result.Add(DescribeHoldout(report));
  result.outputs.push_back({report.out, "lifter"});
  if (training.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"LIFT-NONFINITE", "the loss is not finite after step " + std::to_string(training.steps_done),
                             "train again with a smaller option 'learning-rate'"});
  }
  return result;
}

CommandResult Describe(const LiftApplyReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.metrics["size_m"] = report.size_m;
  result.metrics["rate_hz"] = report.rate_hz > 0 ? ordered_json(report.rate_hz) : ordered_json(nullptr);
  result.Add(DescribeStatuses(report.frames));
  result.folder = report.folder;
  result.outputs.push_back({report.folder + "/points.csv", "points"});
  if (!report.truth) return result;
  result.metrics["truth"] = ScoreJson(*report.truth);
  result.text += ScoreText("against truth", *report.truth);
  return result;
}

}  // namespace mvstudio::stages
