#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/board/sides.h"
#include "calib/check/rig_check.h"
#include "cli/calib/calib.h"
#include "cli/program/arguments.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/units.h"
#include "dataset/session/session.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/calibrate_result.h"
#include "stages/calib/calibration_use.h"
#include "stages/input/calib_read.h"
#include "stages/input/corner_input.h"
#include "stages/input/session_input.h"
#include "stages/report_fields.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string calibration, repair, out;
  stages::SessionArguments session;
  stages::CalibReadOptions read;
  stages::CornerArguments corners;
  calib::RigCheckOptions check;
};

ordered_json CameraJson(const calib::CameraCheck& camera) {
  ordered_json json = stages::FieldsJson(camera);
  if (camera.lens) json["lens"] = stages::FieldsJson(*camera.lens);
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

void FillMetrics(const calib::RigCheck& check, ordered_json* metrics) {
  ordered_json& m = *metrics;
  m["status"] = std::string(ToString(check.status));
  m["verdict"] = stages::VerdictJson(check.verdict);
  m["moved"] = check.moved;
  m["undecided"] = check.undecided;
  m["rms_px"] = FiniteOrNull(check.rms_px);
  m["median_px"] = FiniteOrNull(check.median_px);
  m["num_boards"] = check.num_boards;
  if (!check.found.unknown.empty()) m["left_out"] = check.found.unknown;
  for (const calib::TurnedCamera& camera : check.found.turned)
    m["turned"].push_back({{"name", camera.camera}, {"num_turned", camera.num_turned}, {"num_views", camera.num_views}});
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
  for (const calib::CameraCheck& camera : check.cameras) m["cameras"].push_back(CameraJson(camera));
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

std::string Summary(const calib::RigCheck& check) {
  if (check.num_boards == 0) return LensLines(check) + stages::VerdictLine(check.verdict);
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
  return text + stages::VerdictLine(check.verdict);
}

/// Nothing is written where no camera has a new pose: what was given stays what is best known.
void Repair(const calib::RigCheck& check, const std::string& path, CommandResult* result) {
  const OutputFiles place({path}, result->inputs);
  result->metrics["repaired"] = check.moved;
  if (check.moved.empty()) {
    const bool undecided = !check.undecided.empty();
    result->text += undecided ? "it is not known which camera has moved" : "no camera has moved";
    result->text += ": nothing to repair, " + path + " is not written\n";
    return;
  }
  geometry::WriteRig(check.repaired, path);
  result->outputs.push_back({path, "calibration"});
  result->Add(stages::DescribeWrittenCovariance(check.repaired));
}

/// Refuses corners of which the calibration has no camera. Throws FormatError.
void RequireKnownCamera(const geometry::Rig& rig, const std::string& path, const calib::CalibrateInput& input) {
  std::vector<std::string> names;
  for (const calib::CameraInput& camera : input.cameras) names.push_back(camera.name);
  if (std::any_of(names.begin(), names.end(), [&](const std::string& name) { return rig.Find(name) >= 0; })) return;
  throw FormatError(path, "cameras",
                    "has no " + Join(names, ", ") + "; it has " + Join(geometry::CameraNames(rig), ", ") +
                        ": rename its cameras with calib convert --rename");
}

void ReportLeftOut(const std::vector<std::string>& unknown, const std::string& path, CommandResult* result) {
  if (unknown.empty()) return;
  result->exit = kExitPartial;
  result->warnings.push_back({"CAL-LEFTOUT", path + " has no calibration of " + Join(unknown, ", ") + ": left out here",
                              "rename its cameras with calib convert --rename, or calibrate them too"});
}

constexpr char kResultFile[] = "calib_eval.result.json";

/// From a session what was not named: its calibration, board and footage.
void FillFromSession(Arguments* arguments, CommandResult* result) {
  if (arguments->calibration.empty() && !arguments->session.session.empty()) {
    const bool outside = arguments->session.allow_outside;
    arguments->calibration = dataset::CalibrationOf(dataset::ReadSession(arguments->session.session, outside), outside);
  }
  if (arguments->calibration.empty())
    throw UsageError("CALIB is needed: the calibration to check, or a --session that has been calibrated");
  stages::FillCorners(arguments->session, &arguments->corners, result);
  stages::FillTimeline(&arguments->corners, result);
}

CommandResult Eval(Arguments arguments, CommandContext& context) {
  CommandResult result;
  FillFromSession(&arguments, &result);
  std::optional<OutputFolder> place;
  if (!arguments.out.empty()) {
    place.emplace(arguments.out, Joined(PathsIn(arguments.corners.cameras), {arguments.calibration}),
                  std::vector<std::string>{kResultFile});
    result.folder = arguments.out;
  }
  const calib::ImportedRig imported = stages::ReadCalibrationFiles({arguments.calibration}, arguments.read);
  stages::AddNotes(imported.notes, &result);
  result.inputs.push_back(arguments.calibration);
  const stages::CornerInput corners = stages::ReadCornerInput(arguments.corners, context.run, &result);
  const calib::CalibrateInput& input = corners.input;
  result.text += RemarksOn(corners);
  calib::RequireThickness(input.boards);
  RequireKnownCamera(imported.rig, arguments.calibration, input);
  const calib::RigCheck check = CheckRig(imported.rig, input, arguments.check, context.run);
  ReportLeftOut(check.found.unknown, arguments.calibration, &result);
  FillMetrics(check, &result.metrics);
  if (check.status == Status::kOk) result.text += Summary(check);
  result.Add(
      stages::DescribeCovarianceUse(imported.rig, {}, "cameras are checked against each other by their boards' noise alone"));
  if (check.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"CAL-UNSOLVED", check.message, "show the board to at least two cameras at a time"});
    return result;
  }
  Append(check.verdict.reasons, &result.warnings);
  if (check.verdict.outcome() == calib::Outcome::kFail) result.exit = kExitQualityGate;
  if (!arguments.repair.empty()) Repair(check, arguments.repair, &result);
  return result;
}

}  // namespace

void RegisterCalibEval(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand(
      "eval", "Check a calibration on new footage of a board: has a camera been bumped, which one, how far");
  AddOption(sub, "CALIB", arguments->calibration, "calibration to check; that of --session unless given");
  AddOptions(sub, arguments->corners);
  AddSessionArguments(sub, arguments->session, "calibration, board and footage", "a board");
  StartGroup(sub, "Output");
  AddOutput(sub, "--repair", arguments->repair, OutputKind::kFile,
            "write the calibration with the new poses of the cameras that have moved");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "folder that keeps the check, for mvstudio report");
  StartGroup(sub, "Limits");
  AddOptions(sub, arguments->check);
  StartGroup(sub, "Reading the calibration");
  AddChoice(sub, "--from", arguments->read.from, "format of the calibration: auto, " + calib::CalibrationFormatNames())
      ->capture_default_str()
      ->type_name("FORMAT")
      ->check(OneOf(stages::CalibrationFormatChoices()));
  AddChoice(sub, "--unit", arguments->read.unit, "unit of length of files that name none")
      ->capture_default_str()
      ->check(OneOf({"m", "cm", "mm", "in"}));
  AddMeaningOptions(sub, arguments->read);
  registry.Add(sub, "calib eval", [arguments](CommandContext& context) { return Eval(*arguments, context); });
}

}  // namespace mvstudio::cli
