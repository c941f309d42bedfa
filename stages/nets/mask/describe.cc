#include "stages/nets/mask/describe.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"
#include "core/join.h"

namespace mvstudio::stages {
namespace {

using MaskJson = nlohmann::ordered_json;

std::string MaskPercent(double share) { return Format("%.1f %%", 100 * share); }

MaskJson TrialJson(const MaskTrial& trial) {
  MaskJson json = {{"backend", trial.name}, {"status", std::string(ToString(trial.status))}};
  if (!trial.failed_camera.empty()) json["failed_camera"] = trial.failed_camera;
  json["disagreement_with_hull"] = FiniteOrNull(trial.disagreement);
  json["joints_supported"] = FiniteOrNull(trial.joints_supported);
  return json;
}

std::string WhyText(const MaskTrial& trial) {
  if (!trial.failed_camera.empty())
    return trial.name + " cannot tell people from background (camera " + trial.failed_camera + ")";
  std::string text = trial.name;
  if (std::isfinite(trial.disagreement)) text += " disagrees with the visual hull by " + MaskPercent(trial.disagreement);
  if (std::isfinite(trial.joints_supported)) {
    text += std::string(std::isfinite(trial.disagreement) ? ", its" : "'s") + " colours support " +
            MaskPercent(trial.joints_supported) + " of the joints";
  }
  return text;
}

CommandResult DescribeChoice(const MaskStageReport& report) {
  CommandResult result;
  const std::string& name = report.trials[report.chosen].name;
  result.metrics["backend"] = name;
  if (report.trials.size() < 2) return result;
  const std::string why = Join(report.trials, "; ", WhyText);
  result.metrics["backend_reason"] = why;
  result.metrics["trials"] = MaskJson::array();
  for (const MaskTrial& trial : report.trials) result.metrics["trials"].push_back(TrialJson(trial));
  result.text = "backend " + name + ": " + why + "\n";
  return result;
}

MaskJson CameraMasksJson(const MaskStageReport& report, size_t c) {
  const dataset::TakeMasks& take = report.masks.cameras[c].take;
  const double joints = take.joints > 0 ? take.joints : std::nan("");
  const dataset::HullAgreement a = report.masks.hull.Mean(c);
  const bool compared = report.masks.hull.time_steps > 0;
  return {{"name", report.cameras[c].name},
          {"pictures", take.images},
          {"empty", take.empty},
          {"background_known", report.masks.cameras[c].background_known},
          {"mean_area_fraction", take.mean_area_fraction()},
          {"flicker", take.flicker.Share()},
          {"joints_on_mask", FiniteOrNull(take.joints_on_mask / joints)},
          {"joints_supported", FiniteOrNull(take.joints_supported / joints)},
          {"mask_outside_hull", FiniteOrNull(compared ? a.outside : std::nan(""))},
          {"hull_outside_mask", FiniteOrNull(compared ? a.missing : std::nan(""))},
          {"hull_blame", FiniteOrNull(compared ? a.blame : std::nan(""))},
          {"ms_per_picture", take.ms_per_image()}};
}

CommandResult DescribeMasks(const MaskStageReport& report) {
  CommandResult result;
  double area = 0, flicker = 0, ms = 0, outside = 0, missing = 0;
  int images = 0;
  MaskJson per_camera = MaskJson::array(), disagreeing = MaskJson::array();
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    const dataset::TakeMasks& take = report.masks.cameras[c].take;
    const std::string& name = report.cameras[c].name;
    images += take.images;
    area += take.mean_area_fraction(), flicker += take.flicker.Share(), ms += take.ms_per_image();
    per_camera.push_back(CameraMasksJson(report, c));
    if (report.masks.hull.time_steps > 0)
      outside += report.masks.hull.Mean(c).outside, missing += report.masks.hull.Mean(c).missing;
    result.text += Format("  %s: %d masks, person on %.1f %%, flicker %.4f %%, %.0f ms an image\n", name.c_str(), take.images,
                          100 * take.mean_area_fraction(), 100 * take.flicker.Share(), take.ms_per_image());
    if (!report.masks.cameras[c].sheet.empty())
      result.outputs.push_back({report.options.out + "/" + name + ".sheet.jpg", "overlay"});
  }
  const double n = static_cast<double>(report.cameras.size());
  result.metrics["cameras"] = report.cameras.size();
  result.metrics["pictures"] = images;
  result.metrics["mean_area_fraction"] = area / n;
  result.metrics["flicker"] = flicker / n;
  result.metrics["ms_per_picture"] = ms / n;
  const dataset::HullSummary& hull = report.masks.hull;
  result.metrics["hull_instants"] = hull.time_steps;
  if (hull.time_steps > 0) {
    result.metrics["disagreement_with_hull"] = hull.Disagreement();
    result.text += "disagreement with the visual hull: " + MaskPercent(outside / n) + " of the masks outside it (best: 0 %), " +
                   MaskPercent(missing / n) + " of it in no mask (more, the fewer the cameras)\n";
  }
  for (const size_t c : report.masks.disagreeing) disagreeing.push_back(report.cameras[c].name);
  result.metrics["disagreeing_cameras"] = disagreeing;
  result.metrics["per_camera"] = per_camera;
  return result;
}

/// Where a camera's masks are doubtful by themselves.
CommandResult CameraMaskWarnings(const MaskStageReport::Camera& camera, const MaskCameraResult& masks) {
  CommandResult result;
  const dataset::TakeMasks& take = masks.take;
  const auto warn = [&](const std::string& code, const std::string& text, const std::string& hint) {
    result.warnings.push_back({code, "camera " + camera.name + ": " + text, hint});
  };
  if (!camera.damage.empty()) result.exit = kExitPartial;
  for (const std::string& line : camera.damage) warn("MSK-FRAMES", line, "copy its footage again; the other frames have masks");
  if (take.empty > 0)
    warn("MSK-EMPTY", std::to_string(take.empty) + " of " + std::to_string(take.images) + " masks are empty",
         "is anybody in view? otherwise give joints or another option 'backend'");
  if (masks.background_known < 0.9)
    warn("MSK-BACKGROUND",
         "the background was seen on only " + MaskPercent(masks.background_known) +
             " of the image; colours of the surroundings are used elsewhere",
         "give a clean plate, or footage in which people move");
  if (take.joints > 0 && take.joints_supported < 0.8 * take.joints)
    warn("MSK-JOINTS",
         "only " + MaskPercent(take.joints_supported / double(take.joints)) +
             " of the joints lie where the image shows a person by its colours",
         "check the calibration and the time offset of this camera");
  return result;
}

CommandResult MaskStageWarnings(const MaskStageReport& report) {
  CommandResult result;
  for (const size_t c : report.masks.disagreeing) {
    const dataset::HullAgreement a = report.masks.hull.Mean(c);
    result.warnings.push_back({"MSK-HULL",
                               "camera " + report.cameras[c].name + " disagrees with the others: " + MaskPercent(a.outside) +
                                   " of its masks lie outside the visual hull, " + MaskPercent(a.missing) +
                                   " of the others' hull is not in its masks",
                               "look at its masks; check its calibration and its time offset"});
  }
  for (size_t c = 0; c < report.cameras.size(); ++c) result.Add(CameraMaskWarnings(report.cameras[c], report.masks.cameras[c]));
  if (!report.AllEmpty()) return result;
  result.exit = kExitQualityGate;
  result.errors.push_back({"MSK-NOBODY", "every mask of every camera is empty: nobody was found",
                           "is anybody in view? otherwise give joints, a clean option 'plate', or another option 'backend'"});
  return result;
}

/// Joints that were given and guided no mask of a camera, or of any.
CommandResult DescribeJoints(const MaskStageReport& report) {
  CommandResult result;
  const std::vector<std::string> without = report.WithoutJoints();
  if (without.empty()) return result;
  const std::string given = report.options.pose3d.empty() ? "option 'pose2d'" : "option 'pose3d'";
  const char* hint = "frame numbers of joints and footage must be the same, and the calibration that of these cameras";
  if (without.size() < report.cameras.size()) {
    result.warnings.push_back({"MSK-NO-JOINTS", "no joint of " + given + " lies in an image of " + Join(without, ", "), hint});
    return result;
  }
  std::string frames;
  if (report.pose_frames)
    frames = Format(" (joints are of frames %d to %d)", report.pose_frames->first, report.pose_frames->second);
  result.exit = kExitQualityGate;
  result.errors.push_back(
      {"MSK-NO-JOINTS", "no joint of " + given + frames + " lies in an image of the footage: they guided no mask", hint});
  return result;
}

MaskJson TruthJson(const std::string& camera, const TruthScore& score) {
  const double n = std::max(1, score.images);
  return {{"name", camera},
          {"pictures", score.images},
          {"missing", score.missing},
          {"mean_iou", score.iou_sum / n},
          {"worst_iou", score.worst},
          {"worst_picture", score.worst_image},
          {"too_much_px", score.too_much_px / n},
          {"too_little_px", score.too_little_px / n}};
}

CommandResult DescribeTruth(const MaskStageReport& report) {
  CommandResult result;
  if (report.truth.empty()) return result;
  MaskJson list = MaskJson::array();
  double sum = 0, worst = 1;
  int images = 0;
  std::string worst_image;
  for (size_t i = 0; i < report.truth.size(); ++i) {
    const auto& [camera, path] = report.options.truth[i];
    const TruthScore& score = report.truth[i];
    if (score.from_one) {
      result.warnings.push_back({"MSK-TRUTH",
                                 "camera " + camera +
                                     ": exact masks are numbered 1 to N and the N frames 0 to N - 1: exact mask "
                                     "1 was compared with frame 0",
                                 "number exact masks as frames, from 0, and nothing is said"});
    }
    if (score.images == 0) {
      result.warnings.push_back({"MSK-TRUTH",
                                 "camera " + camera + ": no mask of " + path + " has the number of one of its frames",
                                 "names must end in the frame's number"});
    }
    list.push_back(TruthJson(camera, score));
    sum += score.iou_sum, images += score.images;
    if (score.images > 0 && score.worst <= worst) worst = score.worst, worst_image = score.worst_image;
  }
  if (images == 0) {
    result.exit = kExitQualityGate;
    result.errors.push_back(
        {"MSK-TRUTH", "not one mask was compared with an exact one", "option 'truth' CAMERA=FOLDER, named by frame"});
    return result;
  }
  result.metrics["truth"] = {
      {"pictures", images}, {"mean_iou", sum / images}, {"worst_iou", worst}, {"worst_picture", worst_image}};
  result.metrics["truth_cameras"] = list;
  result.text = Format("against exact masks: mean IoU %.4f over %d images, worst %.4f (%s)\n", sum / images, images, worst,
                       worst_image.c_str());
  return result;
}

}  // namespace

CommandResult Describe(const MaskStageReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (report.outcome == MaskOutcome::kNobody) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"MSK-NOBODY",
                             "camera " + report.trials[report.chosen].failed_camera +
                                 ": nothing separates people from background: no joints, no motion and, where a net was tried, "
                                 "no person found by it",
                             "give joints (option 'pose2d', or option 'calib' and option 'pose3d'), a clean option 'plate', or "
                             "option 'backend' selfie"});
    return result;
  }
  result.folder = report.options.out;
  result.outputs.push_back({report.options.out, "masks"});
  result.Add(DescribeChoice(report));
  result.Add(DescribeMasks(report));
  result.Add(MaskStageWarnings(report));
  result.Add(DescribeJoints(report));
  result.Add(DescribeTruth(report));
  if (report.budget) result.Add(Describe(*report.budget));
  result.metrics["wall_s"] = report.wall_s;
  return result;
}

}  // namespace mvstudio::stages
