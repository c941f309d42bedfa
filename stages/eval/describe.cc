#include "stages/eval/describe.h"

#include <cmath>

#include "core/format.h"
#include "core/join.h"
#include "core/units.h"
#include "stages/calib/calibrate_result.h"
#include "stages/calib/calibration_use.h"
#include "stages/report_fields.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json CheckedCameraJson(const calib::CameraCheck& camera) {
  ordered_json json = FieldsJson(camera);
  if (camera.lens) json["lens"] = FieldsJson(*camera.lens);
  if (camera.status != Status::kOk) return json;
  json["rms_after_px"] = FiniteOrNull(camera.rms_after_px);
  json["rotation_deg"] = FiniteOrNull(RadToDeg(camera.rotation_rad));
  json["rotation_sigma_deg"] = FiniteOrNull(RadToDeg(camera.rotation_sigma_rad));
  json["translation_mm"] = FiniteOrNull(1e3 * camera.translation_m);
  json["translation_sigma_mm"] = FiniteOrNull(1e3 * camera.translation_sigma_m);
  json["shift_px"] = FiniteOrNull(camera.shift_px);
  json["significance"] = FiniteOrNull(camera.significance);
  return json;
}

ordered_json CheckMetrics(const calib::RigCheck& check) {
  ordered_json m;
  m["status"] = std::string(ToString(check.status));
  m["verdict"] = VerdictJson(check.verdict);
  m["moved"] = check.moved;
  m["undecided"] = check.undecided;
  m["rms_px"] = FiniteOrNull(check.rms_px);
  m["median_px"] = FiniteOrNull(check.median_px);
  m["num_boards"] = check.num_boards;
  if (!check.found.unknown.empty()) m["left_out"] = check.found.unknown;
  for (const calib::RotatedCamera& camera : check.found.rotated)
    m["turned"].push_back({{"name", camera.camera}, {"num_turned", camera.num_rotated}, {"num_views", camera.num_views}});
  if (!check.found.frame_shift.empty()) m["frame_shift"] = check.found.frame_shift;
  for (const calib::LateCamera& camera : check.late) m["late"].push_back({{"name", camera.camera}, {"frames", camera.frames}});
  if (check.offsets_stated) {
    const char* const reason = check.offsets_used ? "the corners agree as well with them as without, or better"
                                                  : "the corners agree better without them";
    m["calibration_offsets"] = {{"applied", check.offsets_used}, {"reason", reason}};
  }
  m["scale_error_percent"] = FiniteOrNull(100 * (check.scale - 1));
  const auto& lengths = check.board_metrics;
  const auto figure = [&](double mm) { return FiniteOrNull(check.status == Status::kOk ? mm : std::nan("")); };
  m["board_edge_mm"] = {
      {"rms", figure(lengths.edge_rms_mm)}, {"median", figure(lengths.edge_median_mm)}, {"bias", figure(lengths.edge_bias_mm)}};
  m["pair_distance_rms_mm"] = figure(lengths.pair_rms_mm);
  m["pair_distance_bias_mm"] = figure(lengths.pair_bias_mm);
  m["cameras"] = ordered_json::array();
  for (const calib::CameraCheck& camera : check.cameras) m["cameras"].push_back(CheckedCameraJson(camera));
  return m;
}

/// Of cameras that share no board with another.
std::string LensLines(const calib::RigCheck& check) {
  std::string text;
  for (const calib::CameraCheck& c : check.cameras) {
    if (!c.lens || c.lens->status != Status::kOk) continue;
    text += Format("%s: its lens alone, %d boards: %.3f px as calibrated, %.3f px fitted anew (focal length %.2f -> %.2f px)\n",
                   c.name.c_str(), c.lens->num_views, c.lens->rms_px, c.lens->refitted_rms_px, c.lens->focal_px,
                   c.lens->refitted_focal_px);
  }
  return text;
}

std::string CheckSummary(const calib::RigCheck& check) {
  if (check.num_boards == 0) return LensLines(check) + VerdictLine(check.verdict);
  std::string text = Format("%-16s %6s %8s %8s %8s   %-22s %-22s %8s\n", "camera", "boards", "own px", "rms px", "after px",
                            "turned deg", "moved mm", "shift px");
  for (const calib::CameraCheck& c : check.cameras) {
    text += Format("%-16s %6d %8.3f %8.3f ", c.name.c_str(), c.num_views, c.own_rms_px, c.rms_px);
    if (c.status == Status::kOk) {
      text += Format("%8.3f   %8.4f +- %-8.4f   %8.3f +- %-8.3f   %8.3f%s\n", c.rms_after_px, RadToDeg(c.rotation_rad),
                     RadToDeg(c.rotation_sigma_rad), 1e3 * c.translation_m, 1e3 * c.translation_sigma_m, c.shift_px,
                     c.moved ? "  MOVED" : "");
    } else {
      text += std::string(ToString(c.status)) + "\n";
    }
  }
  text += LensLines(check);
  text += Format("%d boards seen by two cameras or more: rms %.3f px, median %.3f px\n", check.num_boards, check.rms_px,
                 check.median_px);
  if (std::isfinite(check.board_metrics.edge_rms_mm)) {
    text += Format("board edges: rms %.3f mm, median %.3f mm, bias %+.4f mm\n", check.board_metrics.edge_rms_mm,
                   check.board_metrics.edge_median_mm, check.board_metrics.edge_bias_mm);
  }
  text += std::isfinite(check.scale)
              ? Format("lengths by the calibration against the board's: %+.3f %%\n", 100 * (check.scale - 1))
              : "no length of a board could be measured: no two cameras place its corners\n";
  if (check.offsets_used) text += "corners taken at the times that the calibration's time offsets state\n";
  return text + VerdictLine(check.verdict);
}

/// Nothing is written where no camera has a new pose: what was given stays what is best known.
CommandResult DescribeRepair(const EvalReport& report) {
  CommandResult result;
  const std::string& path = report.options.repair;
  result.metrics["repaired"] = report.check.moved;
  if (!report.Repaired()) {
    const bool undecided = !report.check.undecided.empty();
    result.text = undecided ? "it is not known which camera has moved" : "no camera has moved";
    result.text += ": nothing to repair, " + path + " is not written\n";
    return result;
  }
  result.outputs.push_back({path, "calibration"});
  result.Add(DescribeWrittenCovariance(report.check.repaired));
  return result;
}

CommandResult DescribeUnknown(const std::vector<std::string>& unknown, const std::string& path) {
  CommandResult result;
  if (unknown.empty()) return result;
  result.exit = kExitPartial;
  result.warnings.push_back({"CAL-LEFTOUT", path + " has no calibration of " + Join(unknown, ", ") + ": left out here",
                             "rename its cameras with calib convert option 'rename', or calibrate them too"});
  return result;
}

}  // namespace

CommandResult Describe(const EvalReport& report) {
  const calib::RigCheck& check = report.check;
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.folder = report.options.out;
  result.text = RemarksOn(report.corners);
  result.Add(DescribeUnknown(check.found.unknown, report.options.calibration));
  result.metrics = CheckMetrics(check);
  if (check.status == Status::kOk) result.text += CheckSummary(check);
  result.Add(DescribeCovarianceUse(report.rig, {}, "cameras are checked against each other by their boards' noise alone"));
  if (check.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"CAL-UNSOLVED", check.message, "show the board to at least two cameras at a time"});
    return result;
  }
  Append(check.verdict.reasons, &result.warnings);
  if (check.verdict.outcome() == calib::Outcome::kFail) result.exit = kExitQualityGate;
  if (!report.options.repair.empty()) result.Add(DescribeRepair(report));
  return result;
}

}  // namespace mvstudio::stages
