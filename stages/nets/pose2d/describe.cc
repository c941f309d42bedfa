#include "stages/nets/pose2d/describe.h"

#include <cmath>

#include "core/format.h"
#include "core/text/shell_word.h"

namespace mvstudio::stages {
namespace {

using PoseJson = nlohmann::ordered_json;

PoseJson TrialsJson(const std::vector<Pose2dTrial>& trials) {
  PoseJson json = PoseJson::array();
  for (const Pose2dTrial& trial : trials)
    json.push_back({{"backend", trial.backend},
                    {"median_px", FiniteOrNull(trial.agreement.median_px)},
                    {"p90_px", FiniteOrNull(trial.agreement.p90_px)},
                    {"share_ok", trial.agreement.share_ok}});
  return json;
}

PoseJson PoseFiguresJson(const triangulate::LeftOutFigures& figures) {
  return {{"median_px", FiniteOrNull(figures.median_px)},
          {"p90_px", FiniteOrNull(figures.p90_px)},
          {"predicted_median_px", FiniteOrNull(figures.predicted_median_px)},
          {"coverage", FiniteOrNull(figures.coverage)},
          {"num", figures.num_samples}};
}

PoseJson AgreementJson(const PoseAgreement& agreement) {
  PoseJson json = PoseFiguresJson(agreement.all);
  json["share_ok"] = agreement.share_ok;
  json["sigma_px"] = FiniteOrNull(agreement.sigma_px);
  json["sides_fixed"] = agreement.sides_fixed;
  json["method"] = std::string(ToString(agreement.method));
  json["cameras"] = PoseJson::array();
  for (const PoseAgreement::OfCamera& camera : agreement.cameras) {
    PoseJson row{{"name", camera.name}};
    row.update(PoseFiguresJson(camera.figures));
    json["cameras"].push_back(row);
  }
  json["joints"] = PoseJson::array();
  for (const PoseAgreement::OfJoint& joint : agreement.joints) {
    PoseJson row{{"name", joint.name}, {"share_ok", joint.share_ok}};
    if (joint.figures) row.update(PoseFiguresJson(*joint.figures));
    json["joints"].push_back(row);
  }
  return json;
}

PoseJson CameraJson(const CameraPoses& camera) {
  double sum = 0;
  int joints = 0;
  for (const auto& [frame, people] : camera.track.frames) {
    for (const dataset::Person2d& person : people) {
      for (const dataset::Keypoint2d& joint : person.keypoints) sum += joint.score, ++joints;
    }
  }
  PoseJson json{{"name", camera.track.camera}, {"frames", camera.frames}, {"frames_with_people", camera.frames_with_people}};
  json["mean_score"] = joints ? sum / joints : 0;
  json["frames_per_s"] = camera.seconds > 0 ? PoseJson(camera.frames / camera.seconds) : PoseJson(nullptr);
  return json;
}

std::string WhyNothing(const CameraPoses& camera) {
  if (!camera.damage.empty()) return camera.damage.front();
  return camera.numbers.empty() ? "its footage has no frame" : "it has none of the frames that were asked for";
}

CommandResult DescribePoses(const CameraPoses& camera) {
  CommandResult result;
  const std::string& name = camera.track.camera;
  const auto partial = [&](const std::string& code, const std::string& text, const std::string& hint) {
    result.exit = kExitPartial;
    result.warnings.push_back({code, text, hint});
  };
  if (!camera.failure.empty()) partial("POSE-CAMERA", name + ": " + camera.failure, "the other cameras were done");
  if (camera.failure.empty() && camera.frames == 0) {
    partial("POSE-CAMERA", name + " gives nothing: " + WhyNothing(camera),
            "copy its footage again; the other cameras were done");
    return result;
  }
  for (const std::string& line : camera.damage) partial("POSE-FRAMES", name + ": " + line, "the other frames were used");
  if (camera.failure.empty() && camera.frames_with_people * 10 < camera.frames) {
    result.warnings.push_back({"POSE-NOBODY",
                               name + ": somebody is seen in " + std::to_string(camera.frames_with_people) + " of " +
                                   std::to_string(camera.frames) + " frames",
                               "look at the overlay images; try another option 'backend'"});
  }
  return result;
}

Notice OtherSizeNotice(const Pose2dOtherSize& size) {
  const std::string width = std::to_string(size.width_px), height = std::to_string(size.height_px);
  return {"POSE-SIZE",
          size.camera + ": the footage has " + width + " x " + height + " pixels, the calibration " +
              std::to_string(size.calibrated_width_px) + " x " + std::to_string(size.calibrated_height_px),
          "keypoints are in the footage's pixels; triangulating them with this calibration costs that difference: mvstudio "
          "calib resize option 'camera-size' " +
              ShellWord(size.camera + "=" + width + "x" + height) + " brings its lens to them"};
}

/// Keypoints of nobody, or of which no camera's are explained by the others', are no result.
CommandResult JudgePoses(const Pose2dReport& report) {
  CommandResult result;
  if (!report.FoundPeople()) {
    result.exit = kExitQualityGate;
    result.errors.push_back(
        {"POSE-NOBODY", "nobody was found in any image", "look at the overlay images; try another option 'backend'"});
  } else if (report.agreement.measured && !(report.agreement.share_ok > 0)) {
    result.exit = kExitQualityGate;
    result.errors.push_back({"POSE-NO-AGREEMENT",
                             "not one joint could be triangulated: the cameras' keypoints agree on nothing",
                             "is the calibration of these cameras, and was the footage taken at the same time?"});
  }
  return result;
}

std::string PoseSummary(const Pose2dReport& report) {
  int frames = 0, with_people = 0;
  double seconds = 0;
  for (const CameraPoses& camera : report.cameras)
    frames += camera.frames, with_people += camera.frames_with_people, seconds += camera.seconds;
  const std::string text =
      Format("%s: people in %d of %d images, %.2f s an image and thread; skeleton %s, in %s", report.backend.c_str(),
             with_people, frames, frames ? seconds / frames : 0, report.skeleton.name.c_str(), report.out.c_str());
  const PoseAgreement& agreement = report.agreement;
  if (!agreement.measured || !std::isfinite(agreement.median_px)) return text;
  return text + Format("\none camera left out: median %.2f px, p90 %.2f px; %.1f %% of the joints triangulated",
                       agreement.median_px, agreement.p90_px, 100 * agreement.share_ok);
}

}  // namespace

CommandResult Describe(const Pose2dReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (!report.trials.empty()) result.metrics["trials"] = TrialsJson(report.trials);
  result.metrics["backend"] = report.backend;
  result.metrics["skeleton"] = report.skeleton.name;
  result.metrics["cameras"] = PoseJson::array();
  for (const CameraPoses& camera : report.cameras) {
    result.metrics["cameras"].push_back(CameraJson(camera));
    result.Add(DescribePoses(camera));
    if (!camera.track.frames.empty()) result.outputs.push_back({report.out + "/" + camera.track.camera, "pose2d"});
    for (const auto& [frame, image] : camera.overlays)
      result.outputs.push_back({Pose2dOverlayPath(report.out, camera.track.camera, frame), "overlay"});
  }
  for (const Pose2dOtherSize& size : report.other_sizes) result.warnings.push_back(OtherSizeNotice(size));
  if (report.agreement.measured) result.metrics["agreement"] = AgreementJson(report.agreement);
  result.Add(JudgePoses(report));
  result.folder = report.out;
  result.text = PoseSummary(report);
  if (!report.budget) return result;
  result.text += "\n";
  result.Add(Describe(*report.budget));
  return result;
}

}  // namespace mvstudio::stages
