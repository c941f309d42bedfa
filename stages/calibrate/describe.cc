#include "stages/calibrate/describe.h"

#include <algorithm>
#include <map>
#include <set>

#include "core/join.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/board_places.h"
#include "stages/calib/calibrate_result.h"
#include "stages/calib/calibration_use.h"
#include "stages/calibrate/describe_parts.h"
#include "stages/input/board_pairing.h"
#include "stages/people/human_shape.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

/// Where boards were paired by number, a session's videos may know better, or a table of times.
std::string HintFor(const Notice& reason, const CalibrateOptions& options) {
  if (reason.code != "CAL-FRAMES" || options.corners.timeline) return reason.hint;
  const bool footage = !options.corners.cameras.empty();
  if (options.session.session.empty())
    return reason.hint + (footage ? "; a table of their times, option 'timestamps' FILE, pairs them by time" : "");
  return reason.hint +
         "; `mvstudio session timeline` with the board's option 'take' reads dropped frames from time stamps, and " +
         "calibrate then pairs by time";
}

/// Figures of the footage of the cameras that were calibrated, in their order; empty without footage.
std::vector<calib::FootageDetections> FoundOf(const CornerInput& corners, const std::vector<int>& kept) {
  std::vector<calib::FootageDetections> found;
  for (const int c : kept) {
    if (!corners.found.empty()) found.push_back(corners.found[static_cast<size_t>(c)]);
  }
  return found;
}

bool SeesNoBoard(const std::string& name, const calib::CalibrateInput& input) {
  return std::none_of(input.detections.begin(), input.detections.end(),
                      [&](const calib::Detection& d) { return input.cameras[static_cast<size_t>(d.camera_idx)].name == name; });
}

std::string LeftOutHint(const std::string& camera, const std::string& reason, const calib::CalibrateInput& input) {
  if (reason == kNotFilmed) {
    return "the others are written, and later stages leave it out; film the board with it, or add it later with option 'start' "
           "and option 'fix'";
  }
  const std::string hint = "the others are written; film it again, or add it later with option 'start' and option 'fix'";
  if (!SeesNoBoard(camera, input)) return hint;
  return hint +
         "; if it looks at the back of the board, print one there too: option 'board' twice, or two-sided=THICKNESS "
         "(docs/boards.md)";
}

/// The cameras that could not be calibrated while others were, and the session's cameras that the board's take lacks.
CommandResult DescribeLeftOut(const BoardCalibration& found) {
  CommandResult result;
  ordered_json& rows = result.metrics["left_out"] = ordered_json::array();
  for (const calib::LeftOutCamera& camera : found.solved.left_out) {
    std::string reason = camera.reason;
    for (const calib::FootageDetections& footage : found.corners.found) {
      if (footage.camera.name == camera.name && !footage.failure.empty()) reason = footage.failure;
    }
    rows.push_back({{"name", camera.name}, {"reason", reason}});
    result.errors.push_back({"CAL-LEFTOUT", "camera " + camera.name + " is not calibrated: " + reason,
                             LeftOutHint(camera.name, reason, found.corners.input)});
  }
  return result;
}

CommandResult DescribeEarlierWorld(const EarlierWorld& earlier) {
  CommandResult result;
  const std::string gauge = GaugeText(earlier.gauge);
  result.metrics["earlier_world"] = {{"gauge", gauge}, {"kept", earlier.why_lost.empty()}};
  if (earlier.why_lost.empty()) {
    result.text = "the world stays the " + gauge + ", as before; option 'world' camera:NAME makes another\n";
    return result;
  }
  result.warnings.push_back(
      {"CAL-WORLD", "the world of the earlier calibration is lost, which was fixed by: " + gauge + "; " + earlier.why_lost,
       "give option 'world' board:FRAME, or move the rig again with mvstudio calib align"});
  return result;
}

/// Without a floor, the world is a camera's, and nothing is up.
CommandResult AskForFloor(const geometry::RigGauge& gauge, bool in_session, const std::string& path) {
  CommandResult result;
  const std::string what = "the world has the axes of " + GaugeText(gauge) + " (x right, y down, z forward): z is not up";
  const std::string hint =
      "give option 'world' board:FRAME with a frame where the board lies on the floor, or move the rig later: mvstudio "
      "calib align " +
      path + " option 'floor-board' FRAME … or option 'floor-joints' FOLDER";
  if (in_session) result.warnings.push_back({"CAL-WORLD", what, hint});
  if (!in_session) result.text = what + "; " + hint + "\n";
  return result;
}

bool NeedsFloor(const calib::CalibrateReport& solved, const CommandResult& said) {
  const bool one_camera = solved.cameras.size() < 2;  // its lens is what counts
  return solved.rig.gauge.kind == geometry::RigGauge::Kind::kCamera && !one_camera &&
         std::none_of(said.warnings.begin(), said.warnings.end(), [](const Notice& w) { return w.code == "CAL-WORLD"; });
}

/// "a 7, b 153; 6 frames show boards to several cameras"
std::string BoardsSeenText(const calib::CalibrateInput& input) {
  std::map<int, std::set<int64_t>> frames_of;
  std::map<int64_t, int> cameras_at;
  for (const calib::Detection& seen : input.detections) {
    if (frames_of[seen.camera_idx].insert(seen.frame_idx).second) ++cameras_at[seen.frame_idx];
  }
  const std::string cameras = Join(frames_of, ", ", [&](const auto& row) {
    return input.cameras[static_cast<size_t>(row.first)].name + " " + std::to_string(row.second.size());
  });
  const auto shared = std::count_if(cameras_at.begin(), cameras_at.end(), [](const auto& row) { return row.second > 1; });
  return cameras + "; " + std::to_string(shared) + " of them are seen by several cameras";
}

std::string UnsolvedHint(const calib::CalibrateReport& solved, const calib::CalibrateInput& input) {
  const std::string status = "status " + std::string(ToString(solved.status));
  if (solved.status != Status::kNotConverged || input.cameras.size() < 2) return status;
  return status + "; images with a board: " + BoardsSeenText(input) +
         ". Cameras that agree with each other do converge: see whether each is calibrated by itself (option "
         "'intrinsics-only'), and "
         "whether images of one number are of one moment (option 'timestamps', mvstudio sync)";
}

/// A failure has its warnings and what was saved before, nothing else.
CommandResult DescribeUnsolved(const calib::CalibrateReport& solved, const calib::CalibrateInput& input) {
  CommandResult result;
  result.exit = kExitIllPosed;
  result.metrics["status"] = std::string(ToString(solved.status));
  result.metrics["verdict"] = VerdictJson(solved.verdict);
  if (!solved.frame_shift.empty()) result.metrics["frame_shift"] = solved.frame_shift;
  result.errors.push_back({"CAL-UNSOLVED", solved.message, UnsolvedHint(solved, input)});
  return result;
}

CommandResult DescribePlacedBoards(const BoardCalibration& found) {
  CommandResult result;
  const std::vector<calib::Board>& boards = found.corners.input.boards;
  if (boards.size() < 2) return result;
  const PlacedBoards placed = {boards, found.solved.report.rig_from_board, found.behind_sigmas_mm, found.front_of};
  result.metrics["boards"] = BoardPlacesJson(placed);
  result.text = BoardPlacesText(placed);
  return result;
}

CommandResult DescribeVerdict(const calib::Verdict& verdict, const CalibrateOptions& options) {
  CommandResult result;
  for (const auto& reason : verdict.reasons) {  // cameras left out are errors, with their reasons
    if (reason.code != "CAL-LEFTOUT")
      result.warnings.push_back({reason.code, reason.text, HintFor(reason, options), reason.fails});
  }
  if (verdict.outcome() == calib::Outcome::kFail) result.exit = kExitQualityGate;
  return result;
}

CommandResult DescribeSolved(const CalibrateReport& report, const BoardCalibration& found) {
  const calib::CalibrateReport& solved = found.solved.report;
  const dataset::Timeline* timeline = report.options.corners.timeline.get();
  CommandResult result;
  result.outputs.push_back({report.path, "calibration"});
  if (!found.poses_path.empty()) result.outputs.push_back({found.poses_path, "board poses"});
  result.metrics["world"] = WorldText(solved.rig);
  result.metrics.update(CalibrateMetrics(solved, FoundOf(found.corners, found.solved.kept)));
  result.Add(DescribeBoardViews(solved, found.views));
  result.metrics["pairing"] = PairingJson(timeline);
  result.metrics["wall_s"] = found.wall_s;
  const bool of_file = !report.options.corners.corners.empty();
  if (solved.rig.cameras.size() > 1)
    result.text += of_file ? "boards are paired by the time steps of the file of corners\n" : PairingText(timeline);
  result.text += CalibrateSummary(solved);
  return result;
}

CommandResult DescribeFound(const CalibrateReport& report, const BoardCalibration& found) {
  const calib::CalibrateReport& solved = found.solved.report;
  CommandResult result;
  if (!report.options.save_corners.empty()) result.outputs.push_back({report.options.save_corners, "corners"});
  if (found.earlier_world) result.Add(DescribeEarlierWorld(*found.earlier_world));
  if (solved.status != Status::kOk) {
    result.metrics.clear(), result.text.clear();
    result.Add(DescribeUnsolved(solved, found.corners.input));
    result.metrics["pairing"] = PairingJson(report.options.corners.timeline.get());
    return result;
  }
  result.text = RemarksOn(found.corners) + result.text;
  result.Add(DescribeSolved(report, found));
  if (report.options.scene.scene_points.empty()) result.Add(DescribeFilmGain(solved, found.film_gain));
  result.Add(DescribePlacedBoards(found));
  result.Add(DescribeVerdict(solved.verdict, report.options));
  result.Add(DescribeLeftOut(found));
  if (!found.solved.left_out.empty() && result.exit == kExitOk) result.exit = kExitPartial;
  if (NeedsFloor(solved, result))
    result.Add(AskForFloor(solved.rig.gauge, !report.options.session.session.empty(), report.path));
  result.Add(DescribeWrittenCovariance(solved.rig));
  return result;
}

}  // namespace

CommandResult DescribeWritten(const CalibrateReport& report, const geometry::Rig& rig, const std::vector<std::string>& also) {
  CommandResult result = DescribeWrittenCovariance(rig, also);
  result.outputs.push_back({report.path, "calibration"});
  return result;
}

CommandResult Describe(const CalibrateReport& report) {
  const bool unsolved_boards = report.path.empty() && std::holds_alternative<BoardCalibration>(report.found);
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (unsolved_boards) result.inputs.clear();
  if (!report.library_lenses.empty() && !unsolved_boards) result.metrics["lenses_from_library"] = report.library_lenses;
  result.Add(std::visit([&](const auto& found) { return DescribeFound(report, found); }, report.found));
  if (report.budget && !report.path.empty()) result.Add(Describe(*report.budget));
  if (!report.path.empty()) result.folder = report.options.out;
  return result;
}

}  // namespace mvstudio::stages
