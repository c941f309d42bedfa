#include <cmath>

#include "core/format.h"
#include "core/join.h"
#include "stages/triangulate/describe_parts.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json PairJson(const Eigen::Vector2d& v) { return ordered_json::array({v.x(), v.y()}); }

int SidesSwapped(const triangulate::TakeResult& take, const std::string& name) {
  for (const triangulate::CameraSides& camera : take.sides.cameras) {
    if (camera.name == name) return camera.num_swapped;
  }
  return 0;
}

ordered_json DiagnosisJson(const triangulate::TakeResult& take) {
  ordered_json list = ordered_json::array();
  for (const triangulate::CameraDiagnosis& camera : take.cameras) {
    list.push_back({{"name", camera.name},
                    {"mean_residual_px", PairJson(camera.mean_residual_px)},
                    {"sigma_residual_px", PairJson(camera.sigma_residual_px)},
                    {"mean_left_out_residual_px", PairJson(camera.mean_left_out_residual_px)},
                    {"image_scale", PairJson(camera.image_scale)},
                    {"num_detections", camera.num_detections},
                    {"num_rejected", camera.num_rejected},
                    {"num_sides_swapped", SidesSwapped(take, camera.name)},
                    {"off", camera.off},
                    {"scaled", camera.scaled}});
  }
  return list;
}

ordered_json LeftOutJson(const triangulate::LeftOutFigures& f) {
  return {{"num", f.num_samples},
          {"coverage", FiniteOrNull(f.coverage)},
          {"median_px", FiniteOrNull(f.median_px)},
          {"median_error_px", FiniteOrNull(f.median_error_px)},
          {"p90_px", FiniteOrNull(f.p90_px)},
          {"predicted_mean_px", FiniteOrNull(f.predicted_mean_px)},
          {"median_sigmas", FiniteOrNull(f.median_sigmas)}};
}

/// What the other cameras say of each camera's detections.
ordered_json HoldoutMetrics(const triangulate::TakeResult& take, const geometry::Skeleton& skeleton) {
  ordered_json json = LeftOutJson(take.holdout.all);
  json["cameras"] = json["joints"] = ordered_json::array();
  for (size_t c = 0; c < take.holdout.cameras.size(); ++c) {
    ordered_json entry = {{"name", take.cameras[c].name}};
    entry.update(LeftOutJson(take.holdout.cameras[c]));
    json["cameras"].push_back(entry);
  }
  for (size_t j = 0; j < take.holdout.joints.size(); ++j) {
    ordered_json entry = {{"joint", skeleton.joints[j]}};
    entry.update(LeftOutJson(take.holdout.joints[j]));
    json["joints"].push_back(entry);
  }
  return json;
}

ordered_json MethodMetrics(const triangulate::MethodChoice& choice) {
  ordered_json list = ordered_json::array();
  for (size_t m = 0; m < choice.scores.size(); ++m) {
    const triangulate::MethodScore& score = choice.scores[m];
    list.push_back({{"method", score.name},
                    {"holdout_median_px", FiniteOrNull(score.figures.median_px)},
                    {"holdout_p90_px", FiniteOrNull(score.figures.p90_px)},
                    {"coverage", FiniteOrNull(score.figures.coverage)},
                    {"justified", score.justified},
                    {"chosen", m == choice.chosen}});
  }
  return list;
}

ordered_json FilterFiguresJson(const triangulate::LeftOutFigures& figures) {
  return {{"samples", figures.num_samples},
          {"predicted", figures.num_predicted},
          {"median_px", FiniteOrNull(figures.median_px)},
          {"p90_px", FiniteOrNull(figures.p90_px)},
          {"predicted_mean_px", FiniteOrNull(figures.predicted_mean_px)}};
}

ordered_json RefinementJson(const triangulate::SkeletonRefineReport& report) {
  ordered_json trials = ordered_json::array();
  for (const triangulate::TermTrial& trial : report.trials) {
    trials.push_back({{"term", trial.name},
                      {"weight", trial.weight},
                      {"holdout_before_px", FiniteOrNull(trial.before.median_px)},
                      {"holdout_after_px", FiniteOrNull(trial.after.median_px)},
                      {"gain_px", FiniteOrNull(-trial.difference.median_px)},
                      {"gain_error_px", FiniteOrNull(trial.difference.median_error_px)},
                      {"chosen", trial.chosen}});
  }
  return {
      {"robust", report.robust},
      {"smoothness", report.smoothness},
      {"bone_lengths", report.bone_lengths},
      {"holdout_median_px",
       {{"before", FiniteOrNull(report.before.median_px)}, {"after", FiniteOrNull(report.after.median_px)}}},
      {"bone_std_mm", {{"before", FiniteOrNull(report.limb_std_before_mm)}, {"after", FiniteOrNull(report.limb_std_after_mm)}}},
      {"num_filled", report.num_filled},
      {"num_unrefined_frames", report.num_unrefined_frames},
      {"trials", trials}};
}

std::string RefinementText(const triangulate::SkeletonRefineReport& report) {
  std::string terms;
  const auto add = [&terms](const char* name, double weight) {
    if (weight > 0) terms += (terms.empty() ? "" : ", ") + Format(name, weight);
  };
  add("robust", report.robust), add("smoothness %g", report.smoothness), add("bone lengths %g", report.bone_lengths);
  if (terms.empty()) return "refined: no term predicts left-out cameras better, so nothing was changed\n";
  std::string text = Format("refined by %s: one camera left out %.2f -> %.2f px", terms.c_str(), report.before.median_px,
                            report.after.median_px);
  if (std::isfinite(report.limb_std_before_mm))
    text +=
        ", bones vary by " + LengthText(report.limb_std_before_mm / 1e3) + " -> " + LengthText(report.limb_std_after_mm / 1e3);
  text += Format(", %d joints filled\n", report.num_filled);
  if (report.num_unrefined_frames == 0) return text;
  return text +
         Format("%d frames are as they were: their joints do not determine the refined ones\n", report.num_unrefined_frames);
}

}  // namespace

ordered_json PointMetrics(const PointFigures& points) {
  ordered_json m;
  m["num_points"] = points.num_points;
  m["num_joints_tried"] = points.num_tried;
  m["num_sigma_lower_bounds"] = points.num_lower_bounds;
  m["num_joints_carriable"] = points.num_triangulable;
  m["num_persons"] = points.num_persons;
  m["status_counts"] = ordered_json::object();
  for (const auto& [status, count] : points.status_counts) m["status_counts"][std::string(ToString(status))] = count;
  m["mean_rms_px"] = FiniteOrNull(points.mean_rms_px);
  m["median_rms_px"] = FiniteOrNull(points.median_rms_px);
  m["points_per_s"] = FiniteOrNull(points.points_per_s);
  m["median_sigma_mm"] = FiniteOrNull(points.median_sigma_mm);
  m["limb_std_mm"] = FiniteOrNull(points.limb_std_mm);
  m["limbs"] = m["joints"] = ordered_json::array();
  for (const PointFigures::Limb& limb : points.limbs) {
    m["limbs"].push_back({{"person", limb.length.person},
                          {"limb", limb.name},
                          {"num_frames", limb.length.num_frames},
                          {"mean_mm", 1000 * limb.length.mean_m},
                          {"std_mm", 1000 * limb.length.std_m}});
  }
  for (const PointFigures::Joint& joint : points.joints) {
    m["joints"].push_back({{"joint", joint.name},
                           {"num", joint.num},
                           {"sigma_mm", FiniteOrNull(joint.sigma_mm)},
                           {"rms_px", FiniteOrNull(joint.rms_px)}});
  }
  return m;
}

ordered_json TakeMetrics(const triangulate::TakeResult& take, const geometry::Skeleton& skeleton) {
  ordered_json m;
  m["sigma_px"] = take.sigma_px > 0 ? ordered_json(take.sigma_px) : ordered_json();  // exhaustive-dlt knows none
  m["method"] = std::string(ToString(take.method));
  if (!take.choice.scores.empty()) {
    m["method_reason"] = take.choice.reason;
    m["methods"] = MethodMetrics(take.choice);
  }
  m["num_ghosts"] = take.num_ghosts;
  m["holdout"] = HoldoutMetrics(take, skeleton);
  m["cameras"] = DiagnosisJson(take);
  return m;
}

CommandResult DescribeFilter(const FilterCheck& check) {
  CommandResult result;
  result.metrics["filter_holdout"] = {{"cameras", check.num_cameras},
                                      {"before", FilterFiguresJson(check.before)},
                                      {"after", FilterFiguresJson(check.after)},
                                      {"difference_px", FiniteOrNull(check.difference.median_px)},
                                      {"difference_error_px", FiniteOrNull(check.difference.median_error_px)},
                                      {"difference_p90_px", FiniteOrNull(check.difference.p90_px)},
                                      {"difference_p90_error_px", FiniteOrNull(check.difference.p90_error_px)}};
  if (check.num_cameras == 0) return result;
  result.text += Format("filling and filtering, %d cameras left out: median %.2f -> %.2f px, %.1f -> %.1f %% predicted\n",
                        check.num_cameras, check.before.median_px, check.after.median_px, 100 * check.before.coverage,
                        100 * check.after.coverage);
  if (!check.Hurts()) return result;
  result.warnings.push_back({"MRK-FILTER",
                             Format("filtered joints predict left-out cameras worse: median %.2f px instead of %.2f px, p90 "
                                    "%.2f px instead of %.2f px",
                                    check.after.median_px, check.before.median_px, check.after.p90_px, check.before.p90_px),
                             "the filter takes motion away: raise its frequency, or take a shorter one"});
  return result;
}

CommandResult DescribeRefinement(const triangulate::SkeletonRefineReport& report) {
  CommandResult result;
  result.metrics["refinement"] = RefinementJson(report);
  result.text = RefinementText(report);
  return result;
}

}  // namespace mvstudio::stages
