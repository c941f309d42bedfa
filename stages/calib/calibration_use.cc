#include "stages/calib/calibration_use.h"

#include <algorithm>
#include <cmath>

#include "core/join.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "triangulate/sync/sync.h"
#include "triangulate/take/offset_choice.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

constexpr double kLeastOffsetFrames = 0.005;  // below it an offset moves nothing that an image shows

/// Names of the cameras that take part, by whether their lens and pose have covariances.
struct Knowledge {
  std::vector<std::string> known, missing;
  bool any = false;                             // block of any of them
  ordered_json blocks = ordered_json::array();  // what each of `missing` lacks
};

Knowledge KnowledgeOf(const geometry::Rig& rig, const geometry::StatedCovariance& stated,
                      const std::vector<std::string>& cameras) {
  Knowledge knowledge;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::string& name = rig.cameras[c].camera.name;
    if (!cameras.empty() && std::find(cameras.begin(), cameras.end(), name) == cameras.end()) continue;
    knowledge.any = knowledge.any || stated.lens_known[c] || stated.pose_known[c];
    (stated.Knows(c) ? knowledge.known : knowledge.missing).push_back(name);
    if (stated.Knows(c)) continue;
    const char* lacks = stated.pose_known[c] ? "lens" : stated.lens_known[c] ? "pose" : "lens and pose";
    knowledge.blocks.push_back({{"camera", name}, {"lacks", lacks}});
  }
  return knowledge;
}

std::string CovarianceLine(const Knowledge& knowledge, const std::string& unused_because) {
  if (!knowledge.any)
    return "calibration's uncertainty: unknown, it carries no covariance; sigmas hold the detections' noise alone";
  if (!unused_because.empty()) return "calibration's uncertainty: not used, " + unused_because;
  if (knowledge.missing.empty()) return "calibration's uncertainty: in the sigmas, of all cameras";
  return "calibration's uncertainty: in the sigmas where it is known; unknown for " + Join(knowledge.missing, ", ") +
         ", whose part is left out: sigmas of what these cameras see are lower bounds";
}

}  // namespace

std::string CovarianceUse(const geometry::Rig& rig, const std::vector<std::string>& cameras,
                          const std::string& unused_because) {
  const geometry::StatedCovariance stated = geometry::StatedCovarianceOf(rig);
  return CovarianceLine(KnowledgeOf(rig, stated, cameras), unused_because);
}

CommandResult DescribeCovarianceUse(const geometry::Rig& rig, const std::vector<std::string>& cameras,
                                    const std::string& unused_because) {
  CommandResult result;
  const geometry::StatedCovariance stated = geometry::StatedCovarianceOf(rig);
  const Knowledge knowledge = KnowledgeOf(rig, stated, cameras);
  const bool used = knowledge.any && unused_because.empty();
  const std::string line = CovarianceLine(knowledge, unused_because);
  const char* assumed = used && !stated.correlated ? "blocks independent of each other" : nullptr;
  result.metrics["calibration_covariance"] = {
      {"used", used},
      {"reason", line},
      {"known", knowledge.known},
      {"missing", knowledge.blocks},
      {"correlated", stated.correlated},
      {"assumed_for_missing", knowledge.missing.empty() ? ordered_json() : ordered_json("unknown: their part is left out")},
      {"assumed", assumed ? ordered_json(assumed) : ordered_json()}};
  if (used && !knowledge.missing.empty())
    result.warnings.push_back({"CAL-COVARIANCE-MISSING", line, "calibrate again, or take the sigmas for lower bounds"});
  result.text = line + "\n";
  return result;
}

CommandResult DescribeWrittenCovariance(const geometry::Rig& rig, const std::vector<std::string>& also) {
  CommandResult result;
  std::vector<std::string> missing = geometry::CamerasWithoutCovariance(rig);
  for (const std::string& name : also) {
    if (std::find(missing.begin(), missing.end(), name) == missing.end()) missing.push_back(name);
  }
  result.metrics["covariance_missing"] = missing;
  if (!missing.empty()) {
    result.warnings.push_back({"CAL-COVARIANCE-MISSING",
                               "the covariance of " + Join(missing, ", ") +
                                   " is unknown, in whole or in part: what was solved from it does not hold its part",
                               "start from a calibration that states covariances"});
  }
  const std::string why = geometry::WhyJointCovarianceLeftOut(rig);
  result.metrics["joint_covariance_written"] = geometry::HasJointCovariance(rig) && why.empty();
  if (!why.empty())
    result.warnings.push_back({"CAL-COVARIANCE-SIZE", why, "a leaner lens (option 'model') has fewer unknowns"});
  return result;
}

std::vector<double> OffsetsOfCalibration(const geometry::Rig& rig) {
  std::vector<double> offsets;
  bool matters = false;
  for (const geometry::RigCamera& camera : rig.cameras) {
    offsets.push_back(camera.time_offset ? camera.time_offset->frames : 0);
    const bool drifts = camera.time_offset && camera.time_offset->rate != 0;
    matters = matters || drifts || std::abs(offsets.back()) >= kLeastOffsetFrames;
  }
  return matters ? offsets : std::vector<double>();
}

namespace {

std::vector<triangulate::Clock> ClocksOf(const geometry::Rig& rig) {
  std::vector<triangulate::Clock> clocks;
  for (const geometry::RigCamera& camera : rig.cameras) {
    const geometry::TimeOffset offset = camera.time_offset.value_or(geometry::TimeOffset());
    clocks.push_back({offset.frames, 1 + offset.rate});
  }
  return clocks;
}

bool HaveDrift(const std::vector<triangulate::Clock>& clocks) {
  return std::any_of(clocks.begin(), clocks.end(), [](const triangulate::Clock& clock) { return clock.rate != 1; });
}

}  // namespace

nlohmann::ordered_json OffsetUseJson(const OffsetUse& use) {
  ordered_json json = {{"applied", use.applied}, {"reason", use.reason}};
  if (use.applied) json["frames"] = use.frames;
  return json;
}

std::optional<OffsetUse> OffsetsUnused(const geometry::Rig& rig, const std::string& why) {
  if (OffsetsOfCalibration(rig).empty()) return std::nullopt;
  return OffsetUse{false, why};
}

std::optional<OffsetUse> ApplyCalibrationOffsets(AutoOnOff how, const triangulate::TakeOptions& options, const RunContext& run,
                                                 PoseInput* input, InputNotes* notes) {
  const std::vector<double> offsets = OffsetsOfCalibration(input->rig);
  if (offsets.empty()) return std::nullopt;
  if (how == AutoOnOff::kOff) return OffsetsUnused(input->rig, "option 'calibration-offsets' off");
  const std::vector<triangulate::Clock> clocks = ClocksOf(input->rig);
  if (how == AutoOnOff::kAuto && HaveDrift(clocks)) {
    const std::string why = "its clocks run at different rates, so the offsets are those of its own recording";
    notes->warnings.push_back({"TRI-OFFSETS-UNUSED", "the calibration's time offsets are not applied: " + why,
                               "run mvstudio sync on this take; where it is the recording of the calibration, force them with "
                               "option 'calibration-offsets' on"});
    return OffsetsUnused(input->rig, why);
  }
  std::string reason = "option 'calibration-offsets' on";
  if (how == AutoOnOff::kAuto) {
    const triangulate::OffsetTrial trial =
        triangulate::TryOffsets(input->rig, input->frames, offsets, BodyOf(input->skeleton), options, run);
    reason = trial.reason;
    if (!trial.confirmed) {
      notes->warnings.push_back({"TRI-OFFSETS-UNUSED",
                                 "the calibration's time offsets are not applied, the take does not confirm them: " + reason,
                                 "run mvstudio sync on this take, or force them with option 'calibration-offsets' on"});
      return OffsetsUnused(input->rig, reason);
    }
  }
  input->frames = triangulate::ApplyClocks(input->frames, clocks, triangulate::kMeasuredBeyond);
  return OffsetUse{true, reason, offsets};
}

}  // namespace mvstudio::stages
