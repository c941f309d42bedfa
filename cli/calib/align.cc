#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "calib/board/sides.h"
#include "calib/check/seen_corners.h"
#include "calib/keypoints/moments.h"
#include "calib/points/align_rig.h"
#include "cli/calib/calib.h"
#include "cli/program/arguments.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/format.h"
#include "core/units.h"
#include "dataset/pose/markers.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/calibration_use.h"
#include "stages/calib/stated_lengths.h"
#include "stages/input/calib_read.h"
#include "stages/input/corner_input.h"
#include "stages/input/session_input.h"
#include "stages/people/feet_floor.h"
#include "stages/people/human_shape.h"

namespace mvstudio::cli {
namespace {

using calib::RigAlignment;
using nlohmann::ordered_json;

struct Arguments {
  std::string calibration, floor_joints, marker_unit, out;
  int64_t floor_board = -1;
  std::vector<std::string> points, lengths;
  bool scale = false;
  stages::CalibReadOptions read;
  stages::SessionArguments session;
  stages::CornerArguments corners;
  calib::PointResectionOptions clicks;
};

void CheckArguments(const Arguments& a) {
  const int ways = (a.floor_board >= 0) + !a.floor_joints.empty() + !a.points.empty();
  if (ways != 1) throw UsageError("give one of --floor-board, --floor-joints and --points: what the new world is");
  if (a.scale && a.points.empty()) throw UsageError("--scale belongs to --points: neither a board nor feet change the scale");
  if (!a.lengths.empty() && a.points.empty())
    throw UsageError("--length needs --points: what was triangulated with this calibration, or marks camera,point,x_px,y_px");
  if (!a.lengths.empty() && a.scale)
    throw UsageError("--scale takes the size from the places of points, --length from their distances: give one of them");
  const bool footage = !a.session.session.empty() || !a.corners.cameras.empty() || !a.corners.corners.empty();
  if (a.floor_board >= 0 && !footage)
    throw UsageError("--floor-board needs the board's corners: --session, --camera with --board, or --corners");
}

/// What was put right about the corners.
void SayFound(const calib::CornerFindings& found, CommandResult* result) {
  for (const calib::TurnedCamera& camera : found.turned)
    result->warnings.push_back(
        {"CAL-NUMBERING", NumberingText(camera), "use a board with an odd and an even number of corners, or one with markers"});
  if (!found.numbers_text.empty())
    result->warnings.push_back(
        {"CAL-FRAMES", found.numbers_text, "number the frames by their time stamps, or give them as --timestamps FILE"});
}

RigAlignment ByBoard(const geometry::Rig& rig, Arguments arguments, CommandContext& context, CommandResult* result) {
  stages::FillCorners(arguments.session, &arguments.corners, result);
  stages::FillTimeline(&arguments.corners, result);
  const stages::CornerInput corners = stages::ReadCornerInput(arguments.corners, context.run, result);
  result->text += RemarksOn(corners);
  calib::RequireThickness(corners.input.boards);
  calib::CornerFindings found;
  const calib::CalibrateInput seen = SeenCorners(rig, corners.input, calib::CameraParts::kByFrame, &found);
  SayFound(found, result);
  return AlignToBoard(rig, AtFrameTimes(seen, StatedLateness(rig, seen)), arguments.floor_board);
}

dataset::Pose3d PointsIn(const std::string& path, const std::string& unit, CommandResult* result) {
  dataset::MarkerFile file;
  dataset::Pose3d pose = dataset::ReadPoints3d(path, unit, "", &file);
  for (const std::string& note : NotesOf(file, path))
    result->warnings.push_back({"MRK-FILE", note, "the points must be in the world of the calibration"});
  return pose;
}

RigAlignment ByFeet(const geometry::Rig& rig, const Arguments& arguments, CommandResult* result) {
  const std::string& folder = arguments.floor_joints;
  const dataset::Pose3d pose = PointsIn(folder, arguments.marker_unit, result);
  result->inputs.push_back(folder);
  if (pose.world != stages::WorldText(rig)) {
    result->warnings.push_back({"CAL-ALIGN",
                                folder +
                                    (pose.world.empty() ? " states no world" : " states another world (" + pose.world + ")") +
                                    "; the calibration's is: " + stages::WorldText(rig),
                                "make sure that it was triangulated with this calibration"});
  }
  const stages::FeetFloor floor = stages::FloorUnderFeet(pose);
  RigAlignment out;
  out.status = floor.status, out.message = floor.message;
  out.num_points = floor.num_places, out.num_used = floor.num_used, out.rms_m = floor.rms_m;
  ordered_json& json = result->metrics["floor"];
  json["tilt_sigma_deg"] = FiniteOrNull(RadToDeg(floor.tilt_sigma_rad));
  json["turned_deg"] = FiniteOrNull(RadToDeg(floor.turned_rad));
  json["level"] = floor.level;
  json["joint_height_mm"] = ordered_json::object();
  for (const auto& [joint, height_m] : floor.joint_height_m) json["joint_height_mm"][joint] = FiniteOrNull(1e3 * height_m);
  if (out.status != Status::kOk) return out;
  out.new_from_old = floor.floor_from_world;
  out.rig = geometry::InWorld(rig, floor.floor_from_world);
  out.rig.gauge = geometry::GaugeAfterMove({geometry::RigGauge::Kind::kFloor}, rig.gauge);
  result->text += Format("z turned by %.2f degrees, tilt known to %.2f degrees; z = 0: %s\n", RadToDeg(floor.turned_rad),
                         RadToDeg(floor.tilt_sigma_rad), floor.level.c_str());
  constexpr double kMostTiltDeg = 1;
  if (RadToDeg(floor.tilt_sigma_rad) > kMostTiltDeg) {
    result->warnings.push_back({"CAL-FLOOR",
                                Format("the floor's tilt is known to %.1f degrees only", RadToDeg(floor.tilt_sigma_rad)),
                                "let people walk about more, in more than one direction"});
  }
  return out;
}

/// The points that lengths are measured between: of a take, or marked in images of one moment.
std::vector<calib::NamedPoints> MomentsOf(const geometry::Rig& rig, const Arguments& arguments, CommandResult* result) {
  const std::vector<std::string>& paths = arguments.points;
  const bool marked = std::filesystem::is_regular_file(paths[0]) && calib::HasClicks(paths[0]);
  if (marked || paths.size() > 1) return {PointsOfMarks(rig, calib::ReadMarks(paths))};
  std::map<std::pair<int, int>, calib::NamedPoints> moments;  // frame, person
  const dataset::Pose3d pose = PointsIn(paths[0], arguments.marker_unit, result);
  for (const dataset::JointRow& row : pose.rows) {
    calib::NamedPoints& points = moments[{row.frame, row.person}];
    if (row.status == Status::kOk) points[row.joint] = row.x_in_world;
  }
  std::vector<calib::NamedPoints> ordered;
  for (auto& [key, points] : moments) ordered.push_back(std::move(points));
  return ordered;
}

RigAlignment ByLengths(const geometry::Rig& rig, const Arguments& arguments, CommandResult* result) {
  result->inputs.insert(result->inputs.end(), arguments.points.begin(), arguments.points.end());
  const std::vector<calib::StatedLength> stated = calib::ParseStatedLengths(arguments.lengths);
  const std::vector<calib::NamedPoints> moments = MomentsOf(rig, arguments, result);
  std::set<std::string> names;
  for (const calib::NamedPoints& points : moments)
    for (const auto& [name, x] : points) names.insert(name);
  const calib::LengthScale scale = ScaleFromLengths(LengthsOf(stated, {names.begin(), names.end()}), moments);
  RigAlignment out;
  out.status = scale.status, out.message = scale.message;
  out.num_points = static_cast<int>(names.size());
  if (out.status != Status::kOk) return out;
  result->Add(stages::DescribeLengths(scale));
  out.num_used = static_cast<int>(scale.rows.size()), out.scale = scale.scale;
  out.rig = geometry::InWorld(rig, {}, scale.scale);
  out.rig.gauge.stated_lengths = true;
  return out;
}

RigAlignment ByPoints(const geometry::Rig& rig, const Arguments& arguments, CommandResult* result) {
  result->inputs.insert(result->inputs.end(), arguments.points.begin(), arguments.points.end());
  if (arguments.points.size() == 1 && calib::HasPlacePairs(arguments.points[0]))
    return AlignToPlaces(rig, calib::ReadPlacePairs(arguments.points[0]), arguments.scale);
  return AlignToClicks(rig, calib::ReadScenePoints(arguments.points), arguments.scale, arguments.clicks);
}

void AddMotion(const RigAlignment& found, ordered_json* metrics) {
  ordered_json& m = *metrics;
  const Eigen::Quaterniond& q = found.new_from_old.rotation;
  const Eigen::Vector3d& t = found.new_from_old.translation;
  m["new_from_old"] = {{"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}}, {"translation", {t.x(), t.y(), t.z()}}};
  m["scale"] = found.scale;
}

void Describe(const RigAlignment& found, CommandResult* result) {
  ordered_json& m = result->metrics;
  m["status"] = std::string(ToString(found.status));
  m["num_points"] = found.num_points, m["num_used"] = found.num_used;
  m["rms_px"] = FiniteOrNull(found.rms_px), m["rms_mm"] = FiniteOrNull(1e3 * found.rms_m);
  for (const std::string& point : found.gross)
    result->warnings.push_back({"CAL-CLICK", point + " off", "mark it again, or check its coordinates"});
  if (found.status != Status::kOk) return;
  AddMotion(found, &m);
  m["gauge"] = GaugeText(found.rig.gauge);
  if (m.contains("lengths")) return;
  const std::string rms = std::isfinite(found.rms_px) ? Format("%.3f px", found.rms_px) : stages::LengthText(found.rms_m);
  result->text += Format("%d of %d points, rms %s", found.num_used, found.num_points, rms.c_str());
  if (found.scale != 1) result->text += Format(", scale %.6f", found.scale);
  result->text += "\n";
}

/// Where the cameras are beside the floor.
void DescribeHeights(const geometry::Rig& rig, bool has_floor, CommandResult* result) {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  size_t below = 0;
  ordered_json& heights = result->metrics["camera_height_m"] = ordered_json::object();
  for (const geometry::RigCamera& camera : rig.cameras) {
    const double z = camera.CenterInWorld().z();
    heights[camera.camera.name] = FiniteOrNull(z);
    lowest = std::min(lowest, z), highest = std::max(highest, z), below += z < 0;
  }
  result->text +=
      Format("cameras between z = %.2f and %.2f m; world fixed by: %s\n", lowest, highest, GaugeText(rig.gauge).c_str());
  if (!has_floor || below == 0) return;
  result->warnings.push_back({"CAL-FLOOR", Format("%zu of %zu cameras are below the floor", below, rig.cameras.size()),
                              "check the frame of the board, or whether the people's joints are those of this calibration"});
}

CommandResult Align(const Arguments& arguments, CommandContext& context) {
  CheckArguments(arguments);
  CommandResult result;
  const OutputFiles place({arguments.out},
                          Joined({arguments.calibration}, Joined(arguments.points, PathsIn(arguments.corners.cameras))));
  const calib::ImportedRig given = stages::ReadCalibrationFiles({arguments.calibration}, arguments.read);
  stages::RequirePoses(given.rig, arguments.calibration);
  stages::AddNotes(given.notes, &result);
  result.inputs.push_back(arguments.calibration);
  const RigAlignment found = arguments.floor_board >= 0        ? ByBoard(given.rig, arguments, context, &result)
                             : !arguments.floor_joints.empty() ? ByFeet(given.rig, arguments, &result)
                             : !arguments.lengths.empty()      ? ByLengths(given.rig, arguments, &result)
                                                               : ByPoints(given.rig, arguments, &result);
  Describe(found, &result);
  if (found.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"CAL-UNSOLVED", found.message, "status " + std::string(ToString(found.status))});
    return result;
  }
  constexpr double kMostPx = 1;
  if (found.rms_px > kMostPx && arguments.floor_board >= 0) {
    result.warnings.push_back({"CAL-ALIGN", Format("the board lies %.2f px (rms) off the rig's projections", found.rms_px),
                               "check the board's squares, and with mvstudio calib eval whether a camera has moved"});
  }
  DescribeHeights(found.rig, arguments.points.empty(), &result);
  geometry::WriteRig(found.rig, arguments.out);
  result.outputs.push_back({arguments.out, "calibration"});
  result.Add(stages::DescribeWrittenCovariance(found.rig, found.unknown));
  return result;
}

}  // namespace

void RegisterCalibAlign(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand(
      "align", "Move a calibrated rig to another world: a board on the floor, the floor under people's feet, or known points");
  AddOption(sub, "CALIB", arguments->calibration, "calibration to move")->required();
  StartGroup(sub, "World and size");
  AddOption(sub, "--floor-board", arguments->floor_board,
            "frame in which the board lies on the floor: z up, x along its columns, origin at its first corner")
      ->check(CLI::NonNegativeNumber);
  AddOption(sub, "--floor-joints", arguments->floor_joints,
            "3D joints, a folder of triangulate: the floor is the plane on which people's feet stand");
  AddOption(sub, "--points", arguments->points,
            "CSV point,x,y,z,x_old,y_old,z_old (metres): points in both worlds; or as --scene-points of calibrate: point,x,y,z "
            "and camera,point,x_px,y_px, in one file or two")
      ->take_all();
  AddOption(sub, "--length", arguments->lengths,
            std::string(stages::kLengthHelp) + "; --points is then the take, a folder or table of triangulate")
      ->take_all();
  AddOption(sub, "--marker-unit", arguments->marker_unit,
            "m, cm, mm, in or the length of one unit, e.g. 25mm: of joints in a file of another program");
  AddFlag(sub, "--scale", arguments->scale, "--points: also change the rig's scale");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFile, "file to write")->required();
  AddSessionArguments(sub, arguments->session, "board and footage", "a board");
  AddOptions(sub, arguments->corners);
  AddOption(sub, "--click-sigma-px", arguments->clicks.click_sigma_px,
            "px; expected standard deviation of a marked point, per coordinate")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  StartGroup(sub, "Reading the calibration");
  AddChoice(sub, "--from", arguments->read.from, "format of the calibration: auto, " + calib::CalibrationFormatNames())
      ->capture_default_str()
      ->type_name("FORMAT")
      ->check(OneOf(stages::CalibrationFormatChoices()));
  AddMeaningOptions(sub, arguments->read);
  registry.Add(sub, "calib align", [arguments](CommandContext& context) { return Align(*arguments, context); });
}

}  // namespace mvstudio::cli
