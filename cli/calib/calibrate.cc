#include "calib/calibrate.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>

#include "calib/board/sides.h"
#include "calib/corners/corner_files.h"
#include "calib/pipeline/solvable.h"
#include "cli/calib/calib.h"
#include "cli/calib/earlier_world.h"
#include "cli/calib/keypoints.h"
#include "cli/calib/scene.h"
#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/text/shell_word.h"
#include "dataset/session/session.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/board_places.h"
#include "stages/calib/board_poses.h"
#include "stages/calib/board_views.h"
#include "stages/calib/calibrate_result.h"
#include "stages/calib/calibration_use.h"
#include "stages/calib/lens_library.h"
#include "stages/input/board_pairing.h"
#include "stages/input/calib_read.h"
#include "stages/input/corner_input.h"
#include "stages/input/session_input.h"
#include "stages/people/human_shape.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  stages::SessionArguments session;
  stages::CornerArguments corners;
  std::string save_corners, start, lenses, out;
  calib::CalibrateOptions calibrate;
  SceneArguments scene;
  KeypointArguments keypoints;
};

void RequireSizes(const stages::CornerInput& corners, const std::string& path) {
  if (!corners.found.empty()) return;  // the footage says it
  for (const calib::CameraInput& camera : corners.input.cameras) {
    if (camera.width_px <= 0 || camera.height_px <= 0)
      throw UsageError(path + " does not say how large the images of camera " + camera.name + " are; give --size WIDTHxHEIGHT");
  }
}

void SaveCorners(const stages::CornerInput& corners, const std::string& path, CommandResult* result) {
  calib::CornerFile file;
  file.cameras = corners.input.cameras;
  file.boards = corners.input.boards;
  file.detections = corners.input.detections;
  const OutputFiles place({path}, result->inputs);
  calib::WriteCornerFile(file, path);
  result->outputs.push_back({path, "corners"});
}

/// Where boards were paired by number, a session's videos may know better, or a table of times.
std::string HintFor(const Notice& reason, const Arguments& arguments) {
  if (reason.code != "CAL-FRAMES" || arguments.corners.timeline) return reason.hint;
  const bool footage = !arguments.corners.cameras.empty();
  if (arguments.session.session.empty())
    return reason.hint + (footage ? "; a table of their times, --timestamps FILE, pairs them by time" : "");
  return reason.hint + "; `mvstudio session timeline` with the board's --take reads dropped frames from time stamps, and " +
         "calibrate then pairs by time";
}

/// Figures of the footage of the cameras that were calibrated, in their order; empty without footage.
std::vector<calib::FootageDetections> FoundOf(const stages::CornerInput& corners, const std::vector<int>& kept) {
  std::vector<calib::FootageDetections> found;
  for (const int c : kept) {
    if (!corners.found.empty()) found.push_back(corners.found[static_cast<size_t>(c)]);
  }
  return found;
}

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// Lenses of other image sizes are refused, all by name.
void RequireSameSizes(const calib::CalibrateInput& input, const std::string& path) {
  std::string wrong, sizes;
  for (const calib::CameraInput& camera : input.cameras) {
    const int found = input.start->Find(camera.name);
    if (found < 0) continue;
    const geometry::Camera& lens = input.start->cameras[static_cast<size_t>(found)].camera;
    const bool unknown = camera.width_px <= 0;
    if (unknown || (lens.width_px == camera.width_px && lens.height_px == camera.height_px)) continue;
    wrong += (wrong.empty() ? "" : ", ") + camera.name + " (" + SizeText(lens.width_px, lens.height_px) + ", images " +
             SizeText(camera.width_px, camera.height_px) + ")";
    sizes += " --camera-size " + ShellWord(camera.name + "=" + SizeText(camera.width_px, camera.height_px));
  }
  if (wrong.empty()) return;
  throw UsageError(path + " has lenses of other image sizes: " + wrong +
                   "; for the same part of the sensor: mvstudio calib resize " + ShellWord(path) + sizes +
                   " --out resized.json");
}

geometry::Rig GivenLenses(const std::string& path, CommandResult* result) {
  const calib::ImportedRig given = stages::ReadCalibrationFiles({path}, {});
  stages::AddNotes(given.notes, result);
  result->inputs.push_back(path);
  return given.rig;
}

/// The library's lenses of the session's cameras.
geometry::Rig LibraryLenses(const Arguments& arguments, CommandResult* result) {
  if (arguments.session.session.empty()) throw UsageError("--lenses finds lenses by the serial numbers of a --session");
  const dataset::Session session = dataset::ReadSession(arguments.session.session, arguments.session.allow_outside);
  geometry::Rig lenses = stages::LensesOf(stages::ReadLensLibrary(arguments.lenses), session.cameras);
  result->inputs.push_back(arguments.lenses);
  if (lenses.cameras.empty())
    throw UsageError(arguments.lenses + " has a lens of none of the cameras: check their serial in mvstudio.toml");
  result->metrics["lenses_from_library"] = geometry::CameraNames(lenses);
  return lenses;
}

/// Starts from a given calibration, or from the library's lenses of the session's cameras, which are then held.
void FillStart(Arguments* arguments, calib::CalibrateInput* input, CommandResult* result) {
  if (!arguments->start.empty()) {
    input->start = GivenLenses(arguments->start, result);
    return RequireSameSizes(*input, arguments->start);
  }
  if (arguments->lenses.empty()) return;
  const geometry::Rig lenses = LibraryLenses(*arguments, result);
  calib::HeldPart held;
  for (const calib::CameraInput& camera : input->cameras) {
    if (lenses.Find(camera.name) >= 0) held.cameras.push_back(camera.name);
  }
  if (held.cameras.empty())
    throw UsageError(arguments->lenses + " has a lens of none of the cameras: check their serial in mvstudio.toml");
  result->metrics["lenses_from_library"] = held.cameras;
  arguments->calibrate.fix.push_back(held);
  input->start = lenses;
  RequireSameSizes(*input, arguments->lenses);
}

CommandResult RunOnScene(const Arguments& arguments, CommandContext& context) {
  CommandResult result;
  geometry::Rig lenses;
  if (!arguments.start.empty()) lenses = GivenLenses(arguments.start, &result);
  if (!arguments.lenses.empty()) lenses = LibraryLenses(arguments, &result);
  return RunScene(arguments.scene, lenses, arguments.corners.boards, arguments.out, context, std::move(result));
}

/// Marked points alone, without any lens: they say what the lenses are, as the corners of a board in one picture do.
bool FindsLenses(const Arguments& arguments) {
  return !arguments.scene.scene_points.empty() && arguments.scene.from_scene.empty() && arguments.start.empty() &&
         arguments.lenses.empty();
}

stages::CornerInput PointsAsCorners(Arguments* arguments, CommandResult* result) {
  if (arguments->scene.rigid) throw UsageError("--rigid places a rig that is known: give it with --start");
  const calib::ScenePoints points = calib::ReadScenePoints(arguments->scene.scene_points);
  for (const std::string& path : arguments->scene.scene_points) result->inputs.push_back(path);
  stages::CornerInput corners;
  corners.input = PointsAsBoard(points, arguments->corners.corner_files.sizes);
  if (!arguments->calibrate.world.board_frame && arguments->calibrate.world.camera.empty())
    arguments->calibrate.world.board_frame = 0;
  return corners;
}

bool SeesNoBoard(const std::string& name, const calib::CalibrateInput& input) {
  return std::none_of(input.detections.begin(), input.detections.end(),
                      [&](const calib::Detection& d) { return input.cameras[static_cast<size_t>(d.camera_idx)].name == name; });
}

constexpr char kNotFilmed[] = "the take with the board has no footage of it";

/// The cameras that could not be calibrated while others were, and the session's cameras that the board's take lacks.
void SayLeftOut(const std::vector<calib::LeftOutCamera>& left_out, const stages::CornerInput& corners, CommandResult* result) {
  ordered_json& rows = result->metrics["left_out"] = ordered_json::array();
  for (const calib::LeftOutCamera& camera : left_out) {
    std::string reason = camera.reason;
    for (const calib::FootageDetections& found : corners.found) {
      if (found.camera.name == camera.name && !found.failure.empty()) reason = found.failure;
    }
    rows.push_back({{"name", camera.name}, {"reason", reason}});
    std::string hint = "the others are written; film it again, or add it later with --start and --fix";
    if (reason == kNotFilmed) {
      hint =
          "the others are written, and later stages leave it out; film the board with it, or add it later with --start and "
          "--fix";
    } else if (SeesNoBoard(camera.name, corners.input)) {
      hint +=
          "; if it looks at the back of the board, print one there too: --board twice, or two-sided=THICKNESS (docs/boards.md)";
    }
    result->errors.push_back({"CAL-LEFTOUT", "camera " + camera.name + " is not calibrated: " + reason, hint});
  }
  if (!left_out.empty() && result->exit == kExitOk) result->exit = kExitPartial;
}

/// Without a floor, the world is a camera's, and nothing is up.
void AskForFloor(const geometry::RigGauge& gauge, bool in_session, const std::string& path, CommandResult* result) {
  const bool one_camera = result->metrics["cameras"].size() < 2;  // its lens is what counts
  if (gauge.kind != geometry::RigGauge::Kind::kCamera || one_camera) return;
  const std::string what = "the world has the axes of " + GaugeText(gauge) + " (x right, y down, z forward): z is not up";
  const std::string hint =
      "give --world board:FRAME with a frame where the board lies on the floor, or move the rig later: mvstudio "
      "calib align " +
      path + " --floor-board FRAME … or --floor-joints FOLDER";
  const auto said = [](const Notice& warning) { return warning.code == "CAL-WORLD"; };
  if (std::any_of(result->warnings.begin(), result->warnings.end(), said)) return;
  if (in_session) result->warnings.push_back({"CAL-WORLD", what, hint});
  if (!in_session) result->text += what + "; " + hint + "\n";
}

/// The world of the calibration that is replaced, unless another one is asked for.
void FillWorld(const stages::CornerInput& corners, Arguments* arguments, CommandResult* result) {
  calib::WorldOrigin& world = arguments->calibrate.world;
  if (world.board_frame || !world.camera.empty() || !arguments->start.empty() || arguments->calibrate.intrinsics_only) return;
  const std::string pairing = stages::PairingJson(arguments->corners.timeline.get())["by"];
  std::vector<std::string> footage = PathsIn(arguments->corners.cameras);
  if (!arguments->corners.corners.empty()) footage = {arguments->corners.corners};
  KeepEarlierWorld(arguments->out, EarlierGauge(arguments->out), footage, corners, pairing, &world, result);
}

CommandResult Unsolved(const calib::CalibrateReport& report) {
  CommandResult result;
  result.exit = kExitIllPosed;
  result.metrics["status"] = std::string(ToString(report.status));
  result.metrics["verdict"] = stages::VerdictJson(report.verdict);
  if (!report.frame_shift.empty()) result.metrics["frame_shift"] = report.frame_shift;
  result.errors.push_back({"CAL-UNSOLVED", report.message, "status " + std::string(ToString(report.status))});
  return result;
}

void WriteBoardPoses(const calib::CalibrateReport& report, const std::string& folder, CommandResult* result) {
  const std::string poses = stages::BoardPosesCsv(report), path = folder + "/" + stages::kBoardPosesFile;
  if (poses.empty()) return;
  WriteFileAtomic(path, poses);
  result->outputs.push_back({path, "board poses"});
}

void AddBoardPlaces(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards,
                    const std::vector<int>& front_of, CommandResult* result) {
  if (boards.size() < 2) return;
  const stages::PlacedBoards placed = {boards, report.rig_from_board, stages::BehindSigmasMm(report, boards), front_of};
  result->metrics["boards"] = stages::BoardPlacesJson(placed);
  result->text += stages::BoardPlacesText(placed);
}

std::vector<std::string> InputsOf(const Arguments& arguments) {
  return Joined(PathsIn(arguments.corners.cameras), {arguments.corners.corners, arguments.start, arguments.scene.from_scene});
}

/// Cameras of the session whose footage is to be calibrated that the board's take lacks.
std::vector<calib::LeftOutCamera> NotFilmed(const Arguments& arguments) {
  std::vector<calib::LeftOutCamera> cameras;
  if (arguments.session.session.empty() || !arguments.corners.cameras.empty() || !arguments.corners.corners.empty()) return {};
  for (const std::string& name : stages::CamerasWithoutBoard(arguments.session)) cameras.push_back({name, kNotFilmed});
  return cameras;
}

CommandResult RunCalibrate(Arguments arguments, CommandContext& context) {
  if (arguments.out.empty() && !arguments.session.session.empty()) arguments.out = arguments.session.session + "/calib";
  if (arguments.out.empty()) throw UsageError("--out is required, or a --session to write to");
  std::vector<std::string> names = {"calibration.json", stages::kBoardPosesFile, stages::kBoardViewsFolder};
  if (!arguments.scene.from_scene.empty()) names.push_back("colmap");
  const OutputFolder place(arguments.out, InputsOf(arguments), names);
  const bool from_points = FindsLenses(arguments);
  if (UsesScene(arguments.scene) && !from_points) return RunOnScene(arguments, context);
  CommandResult result;
  const std::vector<calib::LeftOutCamera> not_filmed = NotFilmed(arguments);
  if (!from_points) stages::FillCorners(arguments.session, &arguments.corners, &result);
  stages::FillTimeline(&arguments.corners, &result);
  arguments.corners.footage.all_cameras = false;
  const auto start = std::chrono::steady_clock::now();
  stages::CornerInput corners =
      from_points ? PointsAsCorners(&arguments, &result) : stages::ReadCornerInput(arguments.corners, context.run, &result);
  RequireSizes(corners, from_points ? arguments.scene.scene_points[0] : arguments.corners.corners);
  if (!arguments.save_corners.empty()) SaveCorners(corners, arguments.save_corners, &result);
  const std::vector<int> front_of = calib::PartSides(&corners.input);
  FillStart(&arguments, &corners.input, &result);
  FillWorld(corners, &arguments, &result);
  calib::SolvableCalibration solved = CalibrateSolvable(corners.input, arguments.calibrate, context.run);
  if (from_points && solved.report.rig.gauge == geometry::RigGauge::OfBoard(0))
    solved.report.rig.gauge = {geometry::RigGauge::Kind::kPoints};
  const calib::CalibrateReport& report = solved.report;
  if (report.status != Status::kOk) {
    CommandResult unsolved = Unsolved(report);
    unsolved.metrics["pairing"] = stages::PairingJson(arguments.corners.timeline.get());
    unsolved.warnings = result.warnings;
    unsolved.outputs = result.outputs;
    return unsolved;
  }
  solved.left_out.insert(solved.left_out.end(), not_filmed.begin(), not_filmed.end());
  NameLeftOut(solved.left_out, &solved.report.verdict);
  result.folder = arguments.out;
  const std::string path = arguments.out + "/calibration.json";
  geometry::WriteRig(report.rig, path);
  result.outputs.push_back({path, "calibration"});
  if (!from_points) WriteBoardPoses(report, arguments.out, &result);
  result.metrics["world"] = stages::WorldText(report.rig);
  stages::FillCalibrateMetrics(report, FoundOf(corners, solved.kept), &result.metrics);
  AddBoardViews(arguments.corners, report, solved.kept, arguments.out, context.run, &result);
  result.metrics["pairing"] = stages::PairingJson(arguments.corners.timeline.get());
  result.metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (report.rig.cameras.size() > 1) result.text += stages::PairingText(arguments.corners.timeline.get());
  result.text += stages::CalibrateSummary(report);
  if (!from_points) AddFilmGain(report, corners.input.boards, &result);
  AddBoardPlaces(report, corners.input.boards, front_of, &result);
  for (const auto& reason : report.verdict.reasons) {  // cameras left out are errors, with their reasons
    if (reason.code != "CAL-LEFTOUT")
      result.warnings.push_back({reason.code, reason.text, HintFor(reason, arguments), reason.fails});
  }
  if (report.verdict.outcome() == calib::Outcome::kFail) result.exit = kExitQualityGate;
  SayLeftOut(solved.left_out, corners, &result);
  AskForFloor(report.rig.gauge, !arguments.session.session.empty(), path, &result);
  stages::WarnOfCovariance(report.rig, &result);
  return result;
}

void AddArguments(CLI::App* sub, const std::shared_ptr<Arguments>& arguments) {
  AddCornerArguments(sub, arguments->corners);
  AddSessionArguments(sub, arguments->session, "board and footage", "a board");
  StartGroup(sub, "Output");
  AddOutput(sub, "--save-corners", arguments->save_corners, OutputKind::kFile, "also write the corners that were found, CSV");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "folder for calibration.json; SESSION/calib unless given");
  AddOptions(sub, arguments->calibrate);
}

}  // namespace

void RegisterCalibrate(CLI::App& app, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("calibrate", "Calibrate cameras from footage of a board, or from its corners");
  AddArguments(sub, arguments);
  AddOptions(sub, arguments->scene);
  StartGroup(sub, "Known calibrations");
  AddOption(sub, "--start", arguments->start, "a calibration to start from; its cameras keep their lens models");
  AddOption(sub, "--lenses", arguments->lenses,
            "library of mvstudio calib lenses: lenses of the session's cameras, by their serial; they are held")
      ->excludes("--start");
  registry.Add(sub, "calibrate", [arguments](CommandContext& context) { return RunCalibrate(*arguments, context); });
}

void RegisterCalibRefine(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand("refine",
                                       "Adjust an existing calibration to footage of a board (--fix keeps parts of it) or to "
                                       "people, markers or animals (--from-keypoints)");
  StartGroup(sub, "Known calibrations");
  AddOption(sub, "--calib", arguments->start, "the calibration to refine")->required();
  AddArguments(sub, arguments);
  AddKeypointArguments(sub, arguments->keypoints);
  registry.Add(sub, "calib refine", [arguments](CommandContext& context) {
    const KeypointArguments& keypoints = arguments->keypoints;
    if (keypoints.IsGiven() && arguments->out.empty()) throw UsageError("--out is required with --from-keypoints");
    if (!keypoints.IsGiven() && !keypoints.pose2d.empty()) throw UsageError("--pose2d belongs to --from-keypoints");
    return keypoints.IsGiven() ? RunKeypoints(keypoints, arguments->start, arguments->out, context)
                               : RunCalibrate(*arguments, context);
  });
}

}  // namespace mvstudio::cli
