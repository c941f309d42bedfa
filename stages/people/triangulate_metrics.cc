#include "stages/people/triangulate_metrics.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/format.h"
#include "core/join.h"
#include "core/statistics.h"
#include "stages/people/likely_cause.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json ToJson(const Eigen::Vector2d& v) { return ordered_json::array({v.x(), v.y()}); }

int SidesSwapped(const triangulate::TakeResult& take, const std::string& name) {
  for (const triangulate::CameraSides& camera : take.sides.cameras) {
    if (camera.name == name) return camera.num_swapped;
  }
  return 0;
}

ordered_json CameraMetrics(const triangulate::TakeResult& take) {
  ordered_json list = ordered_json::array();
  for (const triangulate::CameraDiagnosis& camera : take.cameras) {
    list.push_back({{"name", camera.name},
                    {"mean_residual_px", ToJson(camera.mean_residual_px)},
                    {"sigma_residual_px", ToJson(camera.sigma_residual_px)},
                    {"mean_left_out_residual_px", ToJson(camera.mean_left_out_residual_px)},
                    {"image_scale", ToJson(camera.image_scale)},
                    {"num_detections", camera.num_detections},
                    {"num_rejected", camera.num_rejected},
                    {"num_sides_swapped", SidesSwapped(take, camera.name)},
                    {"off", camera.off},
                    {"scaled", camera.scaled}});
  }
  return list;
}

ordered_json ToJson(const triangulate::LeftOutFigures& f) {
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
  ordered_json json = ToJson(take.holdout.all);
  json["cameras"] = json["joints"] = ordered_json::array();
  for (size_t c = 0; c < take.holdout.cameras.size(); ++c) {
    ordered_json entry = {{"name", take.cameras[c].name}};
    entry.update(ToJson(take.holdout.cameras[c]));
    json["cameras"].push_back(entry);
  }
  for (size_t j = 0; j < take.holdout.joints.size(); ++j) {
    ordered_json entry = {{"joint", skeleton.joints[j]}};
    entry.update(ToJson(take.holdout.joints[j]));
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

/// People that two cameras see at once: the second largest number of detections.
int SeenByTwo(const triangulate::DetectedFrame& frame) {
  size_t first = 0, second = 0;
  for (const auto& people : frame.people) {
    if (people.size() > first) {
      second = first, first = people.size();
    } else {
      second = std::max(second, people.size());
    }
  }
  return static_cast<int>(second);
}

}  // namespace

PointStatistics::PointStatistics(int num_joints, std::vector<std::pair<int, int>> limbs)
    : limbs_(std::move(limbs)),
      joint_rms_px_(static_cast<size_t>(num_joints)),
      joint_sigma_mm_(static_cast<size_t>(num_joints)) {}

void PointStatistics::Add(const triangulate::TakeResult& take) {
  solve_s_ += take.solve_s;
  for (const triangulate::TakePoint& entry : take.points) {
    ++num_tried_;
    ++counts_[entry.point.status];
    if (entry.point.status != Status::kOk) continue;
    num_lower_bounds_ += entry.point.num_unknown_cameras > 0 && !entry.point.calibration_covariance.isZero(0);
    const float rms = static_cast<float>(entry.point.rms_px);
    const float sigma = static_cast<float>(1000 * std::sqrt(entry.point.covariance.trace() / 3));
    rms_px_.push_back(rms), sigma_mm_.push_back(sigma);
    joint_rms_px_[static_cast<size_t>(entry.joint_idx)].push_back(rms);
    joint_sigma_mm_[static_cast<size_t>(entry.joint_idx)].push_back(sigma);
  }
  limb_lengths_ = MergeLimbs(limb_lengths_, MeasureLimbs(take.points, limbs_));
  num_persons_ = std::max(num_persons_, take.num_persons);
}

void PointStatistics::AddFrames(const std::vector<triangulate::DetectedFrame>& frames,
                                const triangulate::TakeOptions& options) {
  num_frames_ += static_cast<int>(frames.size());
  for (const triangulate::DetectedFrame& frame : frames) {
    num_carriable_ += NumCarriable(frame, options.min_score, options.max_persons, options.min_views);
    frames_with_people_.resize(std::max(frames_with_people_.size(), frame.people.size()));
    for (size_t c = 0; c < frame.people.size(); ++c) {
      frames_with_people_[c] += !frame.people[c].empty();
      for (const triangulate::DetectedPerson& person : frame.people[c]) {
        for (const triangulate::Keypoint& key : person) CountScore(key);
      }
    }
    const int seen = SeenByTwo(frame);
    num_crowded_ += seen > options.max_persons;
    most_persons_ = std::max(most_persons_, seen);
  }
}

void PointStatistics::CountScore(const triangulate::Keypoint& key) {
  if (!key.px.allFinite()) return;
  if (key.score > 0) {
    ++scores_[static_cast<size_t>(std::min(key.score, 1.0) * 1000)];
  } else {
    num_unscored_ += !key.px.isZero(0);
  }
}

void PointStatistics::WarnOfPersons(int max_persons, CommandResult* result) const {
  if (num_crowded_ == 0) return;
  result->warnings.push_back(
      {"TRI-PERSONS-LEFT-OUT",
       Format("two cameras or more see up to %d people at once, in %d of %d frames; option 'max-persons' %d keeps "
              "the best supported, the others are left out",
              most_persons_, num_crowded_, num_frames_, max_persons),
       "option 'max-persons' " + std::to_string(most_persons_) + " keeps them"});
}

void PointStatistics::WarnOfAbsence(const PoseInput& input, CommandResult* result) const {
  for (const std::string& camera : input.cameras) {
    const size_t c = static_cast<size_t>(input.rig.Find(camera));
    const int seen = c < frames_with_people_.size() ? frames_with_people_[c] : 0;
    if (2 * seen >= num_frames_) continue;
    result->warnings.push_back(
        {"TRI-FEW-DETECTIONS",
         camera + ": people in " + std::to_string(seen) + " of " + std::to_string(num_frames_) + " frames only",
         "check the detector's output for this camera and that all cameras count frames from the same time step"});
  }
}

void PointStatistics::AddTo(const geometry::Skeleton& skeleton, ordered_json* metrics) const {
  ordered_json& m = *metrics;
  m["num_points"] = rms_px_.size();
  m["num_joints_tried"] = num_tried_;
  m["num_sigma_lower_bounds"] = num_lower_bounds_;
  m["num_joints_carriable"] = num_carriable_;
  m["num_persons"] = num_persons_;
  m["status_counts"] = ordered_json::object();
  for (const auto& [status, count] : counts_) m["status_counts"][std::string(ToString(status))] = count;
  m["mean_rms_px"] = FiniteOrNull(Mean(rms_px_));
  m["median_rms_px"] = FiniteOrNull(LinearQuantile(rms_px_, 0.5));
  m["points_per_s"] = FiniteOrNull(num_tried_ / solve_s_);
  m["median_sigma_mm"] = FiniteOrNull(LinearQuantile(sigma_mm_, 0.5));
  m["limb_std_mm"] = FiniteOrNull(1000 * MeanLimbStd(limb_lengths_));
  m["limbs"] = m["joints"] = ordered_json::array();
  for (const triangulate::LimbLength& limb : limb_lengths_) {
    const auto [a, b] = limbs_[static_cast<size_t>(limb.limb)];
    m["limbs"].push_back({{"person", limb.person},
                          {"limb", skeleton.joints[static_cast<size_t>(a)] + "-" + skeleton.joints[static_cast<size_t>(b)]},
                          {"num_frames", limb.num_frames},
                          {"mean_mm", 1000 * limb.mean_m},
                          {"std_mm", 1000 * limb.std_m}});
  }
  for (size_t j = 0; j < skeleton.joints.size(); ++j) {
    m["joints"].push_back({{"joint", skeleton.joints[j]},
                           {"num", joint_rms_px_[j].size()},
                           {"sigma_mm", FiniteOrNull(LinearQuantile(joint_sigma_mm_[j], 0.5))},
                           {"rms_px", FiniteOrNull(LinearQuantile(joint_rms_px_[j], 0.5))}});
  }
}

void AddTakeMetrics(const triangulate::TakeResult& take, const geometry::Skeleton& skeleton, ordered_json* metrics) {
  ordered_json& m = *metrics;
  m["sigma_px"] = take.sigma_px > 0 ? ordered_json(take.sigma_px) : ordered_json();  // exhaustive-dlt knows none
  m["method"] = std::string(ToString(take.method));
  if (!take.choice.scores.empty()) {
    m["method_reason"] = take.choice.reason;
    m["methods"] = MethodMetrics(take.choice);
  }
  m["num_ghosts"] = take.num_ghosts;
  m["holdout"] = HoldoutMetrics(take, skeleton);
  m["cameras"] = CameraMetrics(take);
}

void AddRefinementMetrics(const triangulate::SkeletonRefineReport& report, ordered_json* metrics) {
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
  (*metrics)["refinement"] = {
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

/// A camera of which most detections fit no point of the others.
void WarnOfLeftOut(const triangulate::CameraDiagnosis& camera, CommandResult* result) {
  constexpr int kFewest = 20;
  if (camera.num_detections < kFewest || 2 * camera.num_rejected <= camera.num_detections) return;
  result->warnings.push_back({"TRI-CAMERA-LEFTOUT",
                              Format("%s: %d of its %d detections fit no point of the other cameras", camera.name.c_str(),
                                     camera.num_rejected, camera.num_detections),
                              "look at its keypoints; check its timing (`mvstudio sync`) and that it did not move"});
}

constexpr const char* kOffHint =
    "recalibrate these cameras or refine the rig from this take (`mvstudio calib refine option 'from-keypoints'`); check that "
    "their images have the calibrated size and were not cropped (`mvstudio calib resize` brings lenses to another size)";

/// Cameras whose detections are off: one line each, or one for all where most are.
void WarnOfOff(const std::vector<triangulate::CameraDiagnosis>& cameras, CommandResult* result) {
  std::vector<std::string> off, lines;
  for (const triangulate::CameraDiagnosis& camera : cameras) {
    if (!camera.off) continue;
    const Eigen::Vector2d& px = camera.mean_residual_px;
    off.push_back(camera.name + Format(" (%+.1f, %+.1f)", px.x(), px.y()));
    lines.push_back(camera.message);
  }
  if (off.size() >= 3 && 2 * off.size() > cameras.size()) {
    lines = {Format("detections of %zu of %zu cameras are off on average, px: ", off.size(), cameras.size()) + Join(off, ", ") +
             "; no single camera is to blame, the rig does not quite fit this take"};
  }
  for (size_t i = 0; i < lines.size(); ++i)
    result->warnings.push_back({"TRI-CAMERA-OFF", lines[i], i == 0 ? kOffHint : "as above"});
}

void AddCameraWarnings(const triangulate::TakeResult& take, CommandResult* result) {
  WarnOfOff(take.cameras, result);
  for (const triangulate::CameraDiagnosis& camera : take.cameras) {
    if (camera.off) continue;
    if (camera.scaled) {
      result->warnings.push_back(
          {"TRI-CAMERA-SCALED", camera.message,
           "check that its images have the calibrated size; `mvstudio calib resize` brings its lens to another"});
    } else {
      WarnOfLeftOut(camera, result);
    }
  }
  for (const triangulate::CameraSides& camera : take.sides.cameras) {
    if (camera.message.empty() || 20 * camera.num_swapped < camera.num_frames) continue;
    result->warnings.push_back(
        {"TRI-SIDES-SWAPPED", camera.message,
         "they were swapped back; check the detector on this camera's images (mirrored? seen from behind?)"});
  }
}

std::string PointStatistics::ScoresText(double min_score) const {
  int64_t total = 0, above = 0, below = 0;
  for (size_t i = 0; i < scores_.size(); ++i) total += scores_[i];
  for (size_t i = 0; i < scores_.size(); ++i) above += i + 1 > 1000 * min_score ? scores_[i] : 0;
  if (total == 0 && num_unscored_ == 0) return "";
  if (total == 0) return Format("all %lld joints have score 0, which means not seen", static_cast<long long>(num_unscored_));
  std::string text =
      Format("%lld of %lld detections have a score below option 'min-score' %g and are left out; quantiles 10, 50, 90 %%:",
             static_cast<long long>(total - above), static_cast<long long>(total), min_score);
  size_t bin = 0;
  for (const double share : {0.1, 0.5, 0.9}) {
    while (bin + 1 < scores_.size() && static_cast<double>(below + scores_[bin]) < share * static_cast<double>(total))
      below += scores_[bin++];
    text += Format(" %.3g", static_cast<double>(bin) / 1000);
  }
  return text;
}

int PointStatistics::Count(Status status) const {
  const auto found = counts_.find(status);
  return found == counts_.end() ? 0 : found->second;
}

bool PointStatistics::CheckLoss(const triangulate::TakeOptions& options, CommandResult* result) const {
  const double carriable = static_cast<double>(num_carriable_);
  if (num_ok() > 0 && num_ok() >= kLostShare * carriable) return false;
  const bool none = num_ok() == 0;
  result->exit = none ? kExitIllPosed : kExitQualityGate;
  Notice error{none ? "TRI-NO-POINTS" : "TRI-LOST", "no joint could be triangulated",
               "check that calibration and poses belong to the same cameras and that all cameras count frames alike"};
  if (!none)
    error.text = "only " + std::to_string(num_ok()) + " of " + std::to_string(num_carriable_) +
                 " joints that several cameras see could be triangulated";
  const std::string scores = ScoresText(options.min_score);
  bool known = false;
  if (num_carriable_ == 0 && !scores.empty() && scores.find(" 0 of ") == std::string::npos && scores.rfind("0 of ", 0) != 0) {
    error.text += ": " + scores;
    error.hint = "option 'min-score' with a lower limit, or option 'ignore-scores' where scores say nothing";
    known = true;
  } else if (num_carriable_ == 0) {
    error.text += Format(": no joint is seen by %d cameras in one frame", options.min_views);
    error.hint = "frame numbers of the cameras must overlap: `mvstudio sync` finds offsets";
    known = true;
  } else if (2 * Count(Status::kNotConverged) > num_tried_) {
    error.text +=
        Format("; for %d of %d the search for a point does not end (NotConverged)", Count(Status::kNotConverged), num_tried_);
    error.hint =
        "the rays of a point are parallel to what numbers hold: look at focal lengths and distances of the calibration";
    known = true;
  }
  result->errors.push_back(error);
  return known;
}

void CheckConsistency(const triangulate::TakeResult& take, const geometry::Rig& rig, CommandResult* result) {
  constexpr double kMaxSigmaOfDiagonal = 0.015, kMaxLeftOutOfDiagonal = 0.03, kSearchEnds = 0.25;
  double diagonal_px = 0;
  for (const geometry::RigCamera& camera : rig.cameras)
    diagonal_px += std::hypot(camera.camera.width_px, camera.camera.height_px);
  diagonal_px /= static_cast<double>(rig.cameras.size());
  const triangulate::LeftOutFigures& left_out = take.holdout.all;
  std::string text;
  if (take.sigma_px > kSearchEnds * diagonal_px) {
    text = "views disagree: no noise of detections explains by how much";
  } else if (take.sigma_px > kMaxSigmaOfDiagonal * diagonal_px) {
    text = Format("views disagree: sigma %.1f px is %.1f %% of the image's diagonal", take.sigma_px,
                  100 * take.sigma_px / diagonal_px);
  } else if (left_out.num_samples > 0 && left_out.coverage < 0.5) {
    text = Format("cameras disagree: the others predict only %.0f %% of a camera's detections", 100 * left_out.coverage);
  } else if (left_out.num_samples > 0 && left_out.median_px > kMaxLeftOutOfDiagonal * diagonal_px) {
    text =
        Format("cameras disagree: what the others predict is %.0f px from a camera's detections (median)", left_out.median_px);
  }
  if (text.empty()) return;
  result->exit = kExitQualityGate;
  result->errors.push_back({"TRI-INCONSISTENT", text,
                            "check that each folder belongs to its camera, that all cameras count frames from the same "
                            "time step, and the calibration"});
}

}  // namespace mvstudio::stages
