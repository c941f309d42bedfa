#include "stages/error_budget/describe.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"
#include "stages/report_fields.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;
using triangulate::BudgetCamera;
using triangulate::BudgetError;
using triangulate::BudgetMeasure;
using triangulate::BudgetShare;
using triangulate::BudgetStage;
using triangulate::ErrorBudget;
using triangulate::kBudgetStages;
using triangulate::StatedBudget;
using triangulate::StatedCamera;
using triangulate::StatedShare;

constexpr double kAimedError = 0.05;

ordered_json MeasureJson(const BudgetMeasure& measure) {
  ordered_json json{
      {"num", measure.num}, {"now", measure.now}, {"low", measure.low}, {"high", measure.high}, {"rest", measure.rest}};
  for (const BudgetStage stage : kBudgetStages) {
    const BudgetShare& share = measure.stages[static_cast<size_t>(stage)];
    json["stages"].push_back({{"stage", std::string(ToString(stage))},
                              {"share", share.share},
                              {"low", share.low},
                              {"high", share.high},
                              {"alone", share.alone}});
  }
  return json;
}

ordered_json CameraJson(const BudgetCamera& c) {
  return {{"name", c.name},
          {"rotation_deg", c.rotation_deg},
          {"centre_mm", c.centre_mm},
          {"lens_px", c.lens_px},
          {"offset_frames", FiniteOrNull(c.offset_frames)},
          {"bias_px", {c.bias_px.x(), c.bias_px.y()}},
          {"noise_px", c.noise_px},
          {"num_people", c.num_people},
          {"num_swapped", c.num_swapped},
          {"num_missed", c.num_missed}};
}

/// Lines of one kind of error.
std::string MeasureText(const char* what, const char* unit, const BudgetMeasure& measure) {
  if (measure.num == 0) return "";
  std::string text = Format("%s: %.3g %s now (%.3g to %.3g), %.3g with all truths\n", what, measure.now, unit, measure.low,
                            measure.high, measure.rest);
  for (const BudgetStage stage : kBudgetStages) {
    const BudgetShare& share = measure.stages[static_cast<size_t>(stage)];
    text +=
        Format("  %-16s %8.3f %s  (%.3f to %.3f)  %3.0f %%  alone it brings %.3f\n", std::string(ToString(stage)).c_str(),
               share.share, unit, share.low, share.high, measure.now > 0 ? 100 * share.share / measure.now : 0, share.alone);
  }
  return text;
}

std::string BudgetCamerasText(const std::vector<BudgetCamera>& cameras) {
  std::string text = "camera         rotated deg  moved mm  lens px  offset fr       bias px  noise px  swapped  missed\n";
  for (const BudgetCamera& c : cameras) {
    text +=
        Format("%-12s  %10.3f  %8.2f  %7.3f  %9.3f  %5.2f %6.2f  %8.2f  %7d  %6d\n", c.name.c_str(), c.rotation_deg,
               c.centre_mm, c.lens_px, c.offset_frames, c.bias_px.x(), c.bias_px.y(), c.noise_px, c.num_swapped, c.num_missed);
  }
  return text;
}

/// What of a camera's stage is wrong, by its own figures.
std::string DetailOf(const ErrorBudget& budget, const BudgetCamera& camera) {
  switch (budget.next) {
    case BudgetStage::kCalibration:
      return budget.lens_alone > budget.pose_alone
                 ? Format("its lens, %.2f px off on average", camera.lens_px)
                 : Format("its pose, %.3f degrees and %.1f mm off", camera.rotation_deg, camera.centre_mm);
    case BudgetStage::kSync:
      return Format("%.2f frames off", camera.offset_frames);
    case BudgetStage::kJoints2d:
      return Format("bias (%.2f, %.2f) px, noise %.2f px", camera.bias_px.x(), camera.bias_px.y(), camera.noise_px);
    default:
      return Format("%d of %d people with left and right exchanged, %d missed", camera.num_swapped,
                    camera.num_people + camera.num_missed, camera.num_missed);
  }
}

const char* UnitOf(BudgetError error) {
  return error == BudgetError::kMissing  ? "% missing"
         : error == BudgetError::kJoints ? "mm of the 3D joints"
                                         : "px of left-out cameras";
}

std::string NextText(const ErrorBudget& budget) {
  const BudgetMeasure& measure = budget.Measure(budget.next_by);
  const char* unit = UnitOf(budget.next_by);
  const BudgetShare& share = measure.stages[static_cast<size_t>(budget.next)];
  std::string text = Format("improve next: %s; done perfectly it brings %.3g -> %.3g %s\n",
                            std::string(ToString(budget.next)).c_str(), measure.now, measure.now - share.alone, unit);
  const auto most = std::max_element(budget.next_by_camera.begin(), budget.next_by_camera.end());
  const BudgetCamera& camera = budget.cameras[static_cast<size_t>(most - budget.next_by_camera.begin())];
  return text + Format("  most of one camera: %s brings %.3g %s; %s\n", camera.name.c_str(), *most, unit,
                       DetailOf(budget, camera).c_str());
}

CommandResult DescribeTrue(const ErrorBudget& budget) {
  CommandResult result;
  result.metrics["joints_mm"] = MeasureJson(budget.joints_mm);
  result.metrics["held_out_px"] = MeasureJson(budget.held_out_px);
  result.metrics["missing_percent"] = MeasureJson(budget.missing);
  for (const BudgetCamera& camera : budget.cameras) result.metrics["cameras"].push_back(CameraJson(camera));
  if (budget.joints_mm.num == 0) {
    result.exit = kExitQualityGate;
    result.errors.push_back({"BUD-NO-COMMON", "no joint of the take has a true one: no frame, person or joint name is in both",
                             "give the truth of this take: the same frame numbers, and joints called as in its skeleton"});
    return result;
  }
  result.metrics["next"] = std::string(ToString(budget.next));
  result.metrics["next_unit"] = UnitOf(budget.next_by);
  result.metrics["next_by_camera"] = budget.next_by_camera;
  result.text = MeasureText("3D joints, mean distance from the truth", "mm", budget.joints_mm) +
                MeasureText("left-out cameras, mean distance from what the others predict", "px", budget.held_out_px);
  if (budget.missing.now > 0) result.text += MeasureText("joints without a position", "%", budget.missing);
  result.text += BudgetCamerasText(budget.cameras) + NextText(budget);
  return result;
}

/// The square root of what is left of the mean square when a part of it is gone.
double WithoutPart(const StatedBudget& budget, double share_px2) {
  return std::sqrt(std::max(0.0, budget.mean_px2 - share_px2));
}

/// What a stage's truth would bring at most: a constant shift is no noise, whatever sigma was estimated from it.
double PartOf(const StatedBudget& budget, const StatedShare& share) {
  return std::min(share.share_px2, budget.mean_px2 - budget.shifts_px2);
}

std::string StatedNext(const StatedBudget& budget) {
  const auto largest =
      std::max_element(budget.stages.begin(), budget.stages.end(),
                       [&](const StatedShare& a, const StatedShare& b) { return PartOf(budget, a) < PartOf(budget, b); });
  const double now = std::sqrt(budget.mean_px2), part = PartOf(budget, *largest);
  if (part >= std::max(budget.gross_px2, budget.shifts_px2)) {
    return Format("improve next: %s; without its stated error %.3g -> %.3g px\n", std::string(ToString(largest->stage)).c_str(),
                  now, WithoutPart(budget, part));
  }
  if (budget.gross_px2 > budget.shifts_px2) {
    return Format("improve next: wrong detections, beyond 4 sigma; without them %.3g -> %.3g px\n", now,
                  WithoutPart(budget, budget.gross_px2));
  }
  const auto worst = std::max_element(budget.cameras.begin(), budget.cameras.end(),
                                      [](const StatedCamera& a, const StatedCamera& b) { return a.share_px2 < b.share_px2; });
  return Format(
      "improve next: what no sigma states; most constant in %s, (%.2f, %.2f) px: its calibration, or a bias of its 2D "
      "joints; without all constant shifts %.3g -> %.3g px\n",
      worst->name.c_str(), worst->shift_px.x(), worst->shift_px.y(), now, WithoutPart(budget, budget.shifts_px2));
}

std::string StatedLine(const StatedBudget& budget, const StatedShare& share) {
  const std::string name(ToString(share.stage));
  if (!share.stated) return Format("  %-16s states no sigma: its error is in the rest\n", name.c_str());
  return Format("  %-16s %8.4f px2 +- %.4f  %4.0f %%  moves the joints by %.3f mm\n", name.c_str(), share.share_px2,
                share.share_error_px2, 100 * share.share_px2 / budget.mean_px2, share.moved_mm);
}

CommandResult DescribeStated(const StatedBudget& budget) {
  CommandResult result;
  result.metrics["num"] = budget.num;
  if (budget.num == 0) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"BUD-NO-HELD-OUT",
                             "no joint is seen by 3 cameras in one frame: none can be left out and predicted",
                             "check that the folders belong to one take and their frame numbers to one clock"});
    return result;
  }
  result.metrics["held_out_rms_px"] = std::sqrt(budget.mean_px2), result.metrics["sigma_px"] = budget.sigma_px;
  result.text = Format("left-out cameras: %.3g px RMS over %d samples; of its square, %.4g px2:\n", std::sqrt(budget.mean_px2),
                       budget.num, budget.mean_px2);
  for (const StatedShare& share : budget.stages) {
    result.text += StatedLine(budget, share);
    result.metrics["stages"].push_back({{"stage", std::string(ToString(share.stage))},
                                        {"stated", share.stated},
                                        {"share_px2", share.share_px2},
                                        {"share_error_px2", share.share_error_px2},
                                        {"moved_mm", share.moved_mm}});
  }
  result.metrics["rest_px2"] = budget.rest_px2, result.metrics["constant_shifts_px2"] = budget.shifts_px2;
  result.metrics["gross_px2"] = budget.gross_px2;
  for (const StatedCamera& c : budget.cameras) {
    result.metrics["cameras"].push_back(
        {{"name", c.name}, {"num", c.num}, {"shift_px", {c.shift_px.x(), c.shift_px.y()}}, {"share_px2", c.share_px2}});
  }
  result.text +=
      Format("  %-16s %8.4f px2            %4.0f %%%s\n", "rest, unstated", budget.rest_px2,
             100 * budget.rest_px2 / budget.mean_px2, budget.rest_px2 < 0 ? ": the sigmas state more than there is" : "");
  result.text += Format("constant shifts of the cameras' images are %.4f px2, samples beyond 4 sigma %.4f px2\n",
                        budget.shifts_px2, budget.gross_px2) +
                 StatedNext(budget);
  return result;
}

CommandResult DescribeReliability(const std::vector<StageReliability>& stages) {
  CommandResult result;
  result.text = "stage                                 errors  calibration error  by chance  sigmas should grow by\n";
  for (const StageReliability& stage : stages) {
    ordered_json json{{"stage", stage.stage}, {"num", stage.is.num}};
    if (stage.is.num == 0) {
      result.text += Format("%-36s  none: %s\n", stage.stage.c_str(), stage.why_none.c_str());
    } else {
      json["expected_calibration_error"] = stage.is.error, json["chance"] = stage.is.chance;
      json["sigma_factor"] = stage.is.sigma_factor, json["stated"] = stage.is.stated, json["observed"] = stage.is.observed;
      const bool beyond = stage.is.error > std::max(kAimedError, 2 * stage.is.chance);
      result.text += Format("%-36s %7d  %17.3f  %9.3f  %21.2f%s\n", stage.stage.c_str(), stage.is.num, stage.is.error,
                            stage.is.chance, stage.is.sigma_factor,
                            !beyond                     ? ""
                            : stage.is.sigma_factor > 1 ? "  too sure"
                                                        : "  too cautious");
    }
    result.metrics["reliability"].push_back(json);
  }
  return result;
}

}  // namespace

CommandResult Describe(const ErrorBudgetReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (report.budget) result.Add(DescribeTrue(*report.budget));
  if (report.stated) result.Add(DescribeStated(*report.stated));
  if (!report.reliability.empty()) result.Add(DescribeReliability(report.reliability));
  result.folder = report.folder;
  if (!report.page.empty()) result.outputs.push_back({report.page, "figure"});
  return result;
}

}  // namespace mvstudio::stages
