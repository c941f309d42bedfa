#include <cmath>

#include "core/format.h"
#include "core/join.h"
#include "stages/triangulate/describe_parts.h"

namespace mvstudio::stages {
namespace {

/// A camera of which most detections fit no point of the others.
void WarnOfUnfit(const triangulate::CameraDiagnosis& camera, std::vector<Notice>* notices) {
  constexpr int kFewest = 20;
  if (camera.num_detections < kFewest || 2 * camera.num_rejected <= camera.num_detections) return;
  notices->push_back({"TRI-CAMERA-LEFTOUT",
                      Format("%s: %d of %d of its detections that were looked at fit no point of the other cameras",
                             camera.name.c_str(), camera.num_rejected, camera.num_detections),
                      "look at its keypoints; check its timing (`mvstudio sync`) and that it did not move; option "
                      "'without-camera' " +
                          camera.name + " goes on without it"});
}

constexpr const char* kOffHint =
    "recalibrate these cameras or refine the rig from this take (`mvstudio calib refine option 'from-keypoints'`); check that "
    "their images have the calibrated size and were not cropped (`mvstudio calib resize` brings lenses to another size)";

/// Cameras whose detections are off: one line each, or one for all where most are.
void WarnOfOff(const std::vector<triangulate::CameraDiagnosis>& cameras, std::vector<Notice>* notices) {
  std::vector<std::string> names, off, lines;
  for (const triangulate::CameraDiagnosis& camera : cameras) {
    if (!camera.off) continue;
    const Eigen::Vector2d& px = camera.mean_residual_px;
    names.push_back(camera.name);
    off.push_back(camera.name + Format(" (%+.1f, %+.1f)", px.x(), px.y()));
    lines.push_back(camera.message);
  }
  if (off.size() >= 3 && 2 * off.size() > cameras.size()) {
    lines = {Format("detections of %zu of %zu cameras are off on average, px: ", off.size(), cameras.size()) + Join(off, ", ") +
             "; no single camera is to blame, the rig does not quite fit this take"};
  }
  std::string hint = kOffHint;
  if (names.size() + 2 <= cameras.size() && lines.size() == names.size())
    hint += "; until then, option 'without-camera' " + Join(names, ",") + " goes on with the others";
  for (size_t i = 0; i < lines.size(); ++i) notices->push_back({"TRI-CAMERA-OFF", lines[i], i == 0 ? hint : "as above"});
}

std::string ScoresText(const Loss& loss, double min_score) {
  if (loss.num_scored == 0)
    return Format("all %lld joints have score 0, which means not seen", static_cast<long long>(loss.num_unscored));
  std::string text =
      Format("%lld of %lld detections have a score below option 'min-score' %g and are left out; quantiles 10, 50, 90 %%:",
             static_cast<long long>(loss.num_below), static_cast<long long>(loss.num_scored), min_score);
  for (const double score : loss.score_quantiles) text += Format(" %.3g", score);
  return text;
}

std::string InconsistencyText(const TriangulateReport& report) {
  const triangulate::TakeResult& take = report.take;
  switch (report.inconsistency) {
    case Inconsistency::kNone:
      return "";
    case Inconsistency::kNoNoiseExplains:
      return "views disagree: no noise of detections explains by how much";
    case Inconsistency::kNoise:
      return Format("views disagree: sigma %.1f px is %.1f %% of the image's diagonal", take.sigma_px,
                    100 * take.sigma_px / report.MeanDiagonalPx());
    case Inconsistency::kRarelyPredicted:
      return Format("cameras disagree: the others predict only %.0f %% of a camera's detections",
                    100 * take.holdout.all.coverage);
    case Inconsistency::kFarFromPrediction:
      return Format("cameras disagree: what the others predict is %.0f px from a camera's detections (median)",
                    take.holdout.all.median_px);
  }
  return "";
}

}  // namespace

std::vector<Notice> CameraNotices(const triangulate::TakeResult& take) {
  std::vector<Notice> notices;
  WarnOfOff(take.cameras, &notices);
  for (const triangulate::CameraDiagnosis& camera : take.cameras) {
    if (camera.off) continue;
    if (camera.scaled) {
      notices.push_back({"TRI-CAMERA-SCALED", camera.message,
                         "check that its images have the calibrated size; `mvstudio calib resize` brings its lens to another"});
    } else {
      WarnOfUnfit(camera, &notices);
    }
  }
  for (const triangulate::CameraSides& camera : take.sides.cameras) {
    if (camera.message.empty() || 20 * camera.num_swapped < camera.num_frames) continue;
    notices.push_back({"TRI-SIDES-SWAPPED", camera.message,
                       "they were swapped back; check the detector on this camera's images (mirrored? seen from behind?)"});
  }
  return notices;
}

std::vector<Notice> DetectionNotices(const PointFigures& points, int max_persons) {
  std::vector<Notice> notices;
  for (const auto& [camera, seen] : points.frames_with_people) {
    if (2 * seen >= points.num_frames) continue;
    notices.push_back(
        {"TRI-FEW-DETECTIONS",
         camera + ": people in " + std::to_string(seen) + " of " + std::to_string(points.num_frames) + " frames only",
         "check the detector's output for this camera and that all cameras count frames from the same time step"});
  }
  if (points.num_crowded == 0) return notices;
  notices.push_back(
      {"TRI-PERSONS-LEFT-OUT",
       Format("two cameras or more see up to %d people at once, in %d of %d frames; option 'max-persons' %d keeps "
              "the best supported, the others are left out",
              points.most_persons, points.num_crowded, points.num_frames, max_persons),
       "option 'max-persons' " + std::to_string(points.most_persons) + " keeps them"});
  return notices;
}

CommandResult DescribeLoss(const Loss& loss, const PointFigures& points, const triangulate::TakeOptions& options) {
  CommandResult result;
  if (loss.kind == Loss::Kind::kNone) return result;
  const bool none = loss.kind == Loss::Kind::kAll;
  result.exit = none ? kExitIllPosed : kExitQualityGate;
  Notice error{none ? "TRI-NO-POINTS" : "TRI-LOST", "no joint could be triangulated",
               "check that calibration and poses belong to the same cameras and that all cameras count frames alike"};
  if (!none)
    error.text = "only " + std::to_string(points.num_points) + " of " + std::to_string(points.num_triangulable) +
                 " joints that several cameras see could be triangulated";
  if (loss.reason == Loss::Reason::kScores) {
    error.text += ": " + ScoresText(loss, options.min_score);
    error.hint = "option 'min-score' with a lower limit, or option 'ignore-scores' where scores say nothing";
  } else if (loss.reason == Loss::Reason::kNothingInCommon) {
    error.text += Format(": no joint is seen by %d cameras in one frame", options.min_views);
    error.hint = "frame numbers of the cameras must overlap: `mvstudio sync` finds offsets";
  } else if (loss.reason == Loss::Reason::kEndlessSearch) {
    error.text +=
        Format("; for %d of %d the search for a point does not end (NotConverged)", loss.num_endless, points.num_tried);
    error.hint =
        "the rays of a point are parallel to what numbers hold: look at focal lengths and distances of the calibration";
  } else if (loss.reason == Loss::Reason::kBehind) {
    error.text += Format(": %d of %d would lie behind the cameras", loss.num_behind, points.num_tried);
    error.hint =
        "y counts from the lower edge in DLT coefficients, DLTdv and Argus (option 'flip-y'), or the file's poses go the other "
        "way (option 'invert') or are left-handed (option 'mirror')";
  }
  result.errors.push_back(error);
  return result;
}

CommandResult DescribeInconsistency(const TriangulateReport& report) {
  CommandResult result;
  if (report.inconsistency == Inconsistency::kNone) return result;
  result.exit = kExitQualityGate;
  result.errors.push_back({"TRI-INCONSISTENT", InconsistencyText(report),
                           "check that each folder belongs to its camera, that all cameras count frames from the same "
                           "time step, and the calibration"});
  return result;
}

}  // namespace mvstudio::stages
