#include "stages/refine/describe.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"
#include "core/units.h"
#include "stages/calib/calibration_use.h"
#include "stages/people/likely_cause.h"
#include "stages/report_fields.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json BeforeAfter(double before, double after) {
  return {{"before", FiniteOrNull(before)}, {"after", FiniteOrNull(after)}};
}

ordered_json PxJson(const Eigen::Vector2d& v) { return ordered_json::array({FiniteOrNull(v.x()), FiniteOrNull(v.y())}); }

ordered_json AdjustedCameraJson(const calib::KeypointCamera& camera, const geometry::Camera& lens,
                                const std::string& distortion) {
  return {{"name", camera.name},
          {"rotation_deg", FiniteOrNull(RadToDeg(camera.rotation_rad))},
          {"rotation_sigma_deg", FiniteOrNull(RadToDeg(camera.rotation_sigma_rad))},
          {"translation_mm", FiniteOrNull(1e3 * camera.translation_m)},
          {"translation_sigma_mm", FiniteOrNull(1e3 * camera.translation_sigma_m)},
          {"focal_change_percent", FiniteOrNull(100 * camera.focal_change)},
          {"mean_residual_px",
           {{"before", PxJson(camera.mean_residual_before_px)}, {"after", PxJson(camera.mean_residual_after_px)}}},
          {"distortion", distortion},
          {"model", std::string(geometry::ToString(lens.model))},
          {"num_detections", camera.num_detections}};
}

ordered_json SuspectJson(const calib::KeypointSuspect& suspect) {
  if (suspect.fault == calib::CameraFault::kNone) return nullptr;
  ordered_json json = {{"camera", suspect.corrected.camera.name},
                       {"fault", calib::ToString(suspect.fault)},
                       {"message", suspect.message},
                       {"explained", FiniteOrNull(suspect.explained)}};
  if (suspect.fault == calib::CameraFault::kPose) {
    json["rotation_deg"] = FiniteOrNull(RadToDeg(suspect.rotation_rad));
    json["rotation_sigma_deg"] = FiniteOrNull(RadToDeg(suspect.rotation_sigma_rad));
    json["translation_mm"] = FiniteOrNull(1e3 * suspect.translation_m);
    json["translation_sigma_mm"] = FiniteOrNull(1e3 * suspect.translation_sigma_m);
  } else {
    json["scale"] = FiniteOrNull(suspect.scale);
    json["scale_sigma"] = FiniteOrNull(suspect.scale_sigma);
  }
  return json;
}

ordered_json HeldOutJson(const calib::KeypointHeldOut& part) {
  return {{"part", part.name},
          {"first_frame", part.first_frame},
          {"last_frame", part.last_frame},
          {"num_frames", part.num_frames},
          {"num_train_frames", part.num_train_frames},
          {"kept_input", part.kept_input},
          {"median_px", BeforeAfter(part.before.median_px, part.after.median_px)},
          {"mean_px", BeforeAfter(part.before.mean_px, part.after.mean_px)},
          {"p90_px", BeforeAfter(part.before.p90_px, part.after.p90_px)},
          {"limb_std_mm", BeforeAfter(part.before.limb_std_mm, part.after.limb_std_mm)}};
}

ordered_json RefineMetrics(const calib::KeypointRefineReport& report) {
  ordered_json m;
  const calib::KeypointError &before = report.before, &after = report.after;
  m["holdout_median_px"] = BeforeAfter(before.median_px, after.median_px);
  m["holdout_mean_px"] = BeforeAfter(before.mean_px, after.mean_px);
  m["holdout_p90_px"] = BeforeAfter(before.p90_px, after.p90_px);
  m["limb_std_mm"] = BeforeAfter(before.limb_std_mm, after.limb_std_mm);
  m["limb_mean_mm"] = BeforeAfter(before.limb_mean_mm, after.limb_mean_mm);
  m["num_holdout_joints"] = after.num_joints;
  m["num_holdout_failed"] = {{"before", before.num_failed}, {"after", after.num_failed}};
  m["kept_input"] = report.kept_input;
  m["keypoint_sigma_px"] = FiniteOrNull(report.sigma_px);
  m["keypoint_cauchy_px"] = FiniteOrNull(report.cauchy_px);
  m["num_train_frames"] = report.num_train_frames;
  m["num_test_frames"] = report.num_test_frames;
  m["num_train_joints"] = report.num_train_joints;
  m["held_out"] = ordered_json::array();
  for (const calib::KeypointHeldOut& part : report.held_out) m["held_out"].push_back(HeldOutJson(part));
  m["num_gap_frames"] = report.num_gap_frames;
  m["left_out_persons"] = {{"num_persons", report.left_out.num_persons}, {"num_frames", report.left_out.frames.size()}};
  m["culprit"] = SuspectJson(report.suspect);
  m["cameras"] = ordered_json::array();
  for (size_t c = 0; c < report.cameras.size(); ++c)
    m["cameras"].push_back(
        AdjustedCameraJson(report.cameras[c], report.rig.cameras[c].camera, calib::ToString(report.plan.distortion)));
  m["decisions"] = RowsJson(report.decisions);
  return m;
}

std::string LimbsText(const calib::KeypointError& error) {
  if (!std::isfinite(error.limb_mean_mm)) return "";
  return "; limbs " + LengthText(error.limb_mean_mm / 1e3) + " long +- " + LengthText(error.limb_std_mm / 1e3);
}

std::string AdjustedCameraLine(const calib::KeypointCamera& c, bool kept) {
  const std::string moved =
      kept ? "as given"
           : Format("turned %.3f +- %.3f deg, moved %.1f +- %.1f mm, focal %+.2f %%", RadToDeg(c.rotation_rad),
                    RadToDeg(c.rotation_sigma_rad), 1e3 * c.translation_m, 1e3 * c.translation_sigma_m, 100 * c.focal_change);
  return Format("%-16s %s, mean residual (%+.1f, %+.1f) -> (%+.1f, %+.1f) px\n", c.name.c_str(), moved.c_str(),
                c.mean_residual_before_px.x(), c.mean_residual_before_px.y(), c.mean_residual_after_px.x(),
                c.mean_residual_after_px.y());
}

std::string RefineSummary(const calib::KeypointRefineReport& report) {
  std::string text;
  for (const auto& [name, error] : {std::pair("before", &report.before), std::pair("after", &report.after)})
    text += Format("held-out frames %-6s median %.2f px, mean %.2f px, p90 %.1f px%s\n", name, error->median_px, error->mean_px,
                   error->p90_px, LimbsText(*error).c_str());
  for (const calib::KeypointHeldOut& part : report.held_out)
    text += Format("  %-12s frames %d to %d (%d), adjusted to %d others: median %.2f -> %.2f px, mean %.2f -> %.2f px%s\n",
                   part.name.c_str(), part.first_frame, part.last_frame, part.num_frames, part.num_train_frames,
                   part.before.median_px, part.after.median_px, part.before.mean_px, part.after.mean_px,
                   part.kept_input ? " (input kept)" : "");
  if (report.num_gap_frames > 0)
    text += Format("  %d frames between the halves measure neither; the calibration is adjusted to all %d frames\n",
                   report.num_gap_frames, report.num_train_frames);
  for (const calib::KeypointCamera& c : report.cameras) text += AdjustedCameraLine(c, report.kept_input);
  text += Format("%-16s %-28s %10s %10s\n", "group", "choice", "held-out", "std. error");
  for (const calib::KeypointDecision& d : report.decisions)
    text += Format("%-16s %-28s %7.3f px %7.3f px%s\n", d.group.c_str(), d.choice.c_str(), d.holdout_px, d.standard_error_px,
                   d.chosen            ? "  <-"
                   : d.refusal.empty() ? ""
                                       : ("  " + d.refusal).c_str());
  if (report.suspect.fault != calib::CameraFault::kNone) text += report.suspect.message + "\n";
  if (report.kept_input) text += report.message + "\n";
  return text;
}

std::string LeftOutLine(const calib::LeftOutPersons& others, int max_persons) {
  const size_t count = others.frames.size();
  return Format("%d more %s than option 'max-persons' %d, in %zu %s (%s%d): left out", others.num_persons,
                others.num_persons == 1 ? "person" : "persons", max_persons, count, count == 1 ? "frame" : "frames",
                count == 1 ? "" : "the first: ", others.frames.front());
}

std::vector<Notice> NoticesOf(const calib::KeypointRefineReport& report, size_t num_left_out, int max_persons) {
  std::vector<Notice> notices;
  if (report.kept_input)
    notices.push_back({"CAL-INPUT-KEPT", report.message, "film more, in more of the space, or recalibrate"});
  if (report.suspect.fault != calib::CameraFault::kNone)
    notices.push_back({"CAL-CAMERA-WRONG", report.suspect.message,
                       "the new calibration corrects it; check the camera and its images all the same"});
  if (num_left_out > 0)
    notices.push_back(
        {"CAL-NOT-ADJUSTED", std::to_string(num_left_out) + " cameras without 2D points stay as they are", "give theirs too"});
  if (!report.left_out.frames.empty())
    notices.push_back({"CAL-PERSONS-LEFT-OUT", LeftOutLine(report.left_out, max_persons),
                       "option 'max-persons' " + std::to_string(max_persons + report.left_out.num_persons) + " uses them too"});
  if (!report.lenses.empty())
    notices.push_back(
        {"CAL-LENSES", report.lenses, "boards determine lenses; option 'no-keypoint-lenses' leaves them as given"});
  for (const std::string& note : report.notes)
    notices.push_back({"CAL-HALF-UNSOLVED", note, "the held-out figures are those of the other half alone"});
  return notices;
}

/// Cameras that the person placed, or could not.
CommandResult DescribePlacing(const RefineReport& report) {
  const calib::PlacedRig& placed = *report.placed;
  CommandResult result;
  if (placed.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"CAL-UNPLACED", placed.message,
                             "one person who walks through what all cameras see, and a skeleton whose bones have lengths"});
    return result;
  }
  result.metrics["placed"] = {{"inlier_share", placed.inlier_share}, {"length_spread", placed.length_spread}};
  const std::string by =
      report.skeleton.human ? Format("a person of %.2f m", report.PersonHeightM()) : "the lengths of " + report.skeleton.name;
  if (report.by_height && !(report.options.person_height_m > 0))
    result.warnings.push_back(
        {"CAL-SCALE", "the rig's size rests on " + by + ", which is assumed", "option 'person-height' states it"});
  result.warnings.push_back({"CAL-WORLD", "cameras placed by people: the world is that of " + placed.rig.cameras[0].camera.name,
                             "mvstudio calib align option 'floor-joints', or option 'floor-board', sets the floor"});
  if (report.num_not_placed > 0)
    result.warnings.push_back({"CAL-LEFTOUT", "cameras without 2D points are not in the rig", "give theirs too"});
  return result;
}

CommandResult DescribeUnrefined(const RefineReport& report) {
  const auto cause =
      CauseOfLoss(report.causes, "CAL-CAUSE", "people or markers must be seen by several cameras at once, in many places");
  CommandResult result = cause.said;
  result.exit = kExitIllPosed;
  result.errors.push_back({"CAL-UNSOLVED", report.refined.message, cause.remedy});
  result.text = report.refined.message + "\n";
  return result;
}

CommandResult DescribeUnsteady(const calib::KeypointRefineReport& refined) {
  CommandResult result;
  if (!refined.kept_input) result.exit = kExitQualityGate;
  (refined.kept_input ? result.warnings : result.errors)
      .push_back({"CAL-UNSTEADY", refined.unsteady,
                  "cameras that are not synchronous (`mvstudio sync`, option 'sync'), that moved during the take, or wrong "
                  "names do this"});
  return result;
}

/// Exit 4 where next to nothing of the detections fits, or where one assumption about what is wrong explains the take better
/// than the adjustment does.
CommandResult DescribeFit(const RefineReport& report) {
  const triangulate::CauseTrial& after = report.fit;
  CommandResult result;
  result.metrics["detections_carried"] = after.carried;
  if (after.num_detections == 0) return result;
  const CauseFinding late = CauseInTiming(report.timing, !report.options.sync.empty());
  result.Add(late.said);
  if (!late.clear && !report.refined.unsteady.empty()) result.Add(DescribeUnsteady(report.refined));
  const auto& why = report.causes;
  const CauseFinding cause = CauseOfLoss(why, "CAL-CAUSE", "check that calibration and poses belong to the same cameras");
  result.Add(cause.said);
  // Exchanged cameras can be adjusted until they fit: the given world is then lost.
  const bool over = std::any_of(report.refined.cameras.begin(), report.refined.cameras.end(),
                                [](const auto& camera) { return camera.rotation_rad > 0.5 * kPi; });
  const bool explained = why && !why->message.empty() && (over || why->trials[0].residual_px < after.residual_px);
  if (after.carried >= kLostShare && !explained) return result;
  result.exit = kExitQualityGate;
  result.errors.push_back({"CAL-NOFIT",
                           Format("%.1f %% of the detections fit the calibration that was written, mean residual %.2f px%s",
                                  100 * after.carried, after.residual_px, over ? ", and it turns cameras over" : ""),
                           cause.remedy});
  return result;
}

}  // namespace

CommandResult Describe(const RefineReport& report) {
  const calib::KeypointRefineReport& refined = report.refined;
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (report.placed) result.Add(DescribePlacing(report));
  if (!report.Placed()) return result;
  result.metrics["status"] = std::string(ToString(refined.status));
  if (refined.status != Status::kOk) {
    result.Add(DescribeUnrefined(report));
    return result;
  }
  result.metrics.update(RefineMetrics(refined));
  Append(NoticesOf(refined, report.num_not_adjusted, report.options.adjust.max_persons), &result.warnings);
  result.Add(DescribeFit(report));
  if (report.scale) result.Add(DescribeLengths(*report.scale));
  if (report.path.empty()) return result;
  result.folder = report.options.out;
  result.outputs.push_back({report.path, "calibration"});
  result.text = RefineSummary(refined) + result.text;
  if (report.placed)
    result.text += "all frames placed the cameras first: the figures above are held out from the adjustment alone\n";
  result.Add(DescribeWrittenCovariance(report.written));
  return result;
}

}  // namespace mvstudio::stages
