#include "stages/calibrate/run.h"

#include <algorithm>

#include "calib/board/sides.h"
#include "calib/corners/corner_files.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/stopwatch.h"
#include "core/text/shell_word.h"
#include "dataset/session/session.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/board_places.h"
#include "stages/calib/board_poses.h"
#include "stages/calib/lens_library.h"
#include "stages/calibrate/budget.h"
#include "stages/calibrate/scene.h"
#include "stages/input/calib_read.h"

namespace mvstudio::stages {
namespace {

void RequireSizes(const CornerInput& corners, const std::string& path) {
  if (!corners.found.empty()) return;  // the footage says it
  for (const calib::CameraInput& camera : corners.input.cameras) {
    if (camera.width_px <= 0 || camera.height_px <= 0) {
      throw UsageError(path + " does not say how large the images of camera " + camera.name +
                       " are; give option 'size' WIDTHxHEIGHT");
    }
  }
}

void SaveCorners(const CornerInput& corners, const std::string& path, const InputNotes& notes) {
  calib::CornerFile file;
  file.cameras = corners.input.cameras;
  file.boards = corners.input.boards;
  file.detections = corners.input.detections;
  const OutputFiles place({path}, notes.inputs);
  calib::WriteCornerFile(file, path);
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
    sizes += " option 'camera-size' " + ShellWord(camera.name + "=" + SizeText(camera.width_px, camera.height_px));
  }
  if (wrong.empty()) return;
  throw UsageError(path + " has lenses of other image sizes: " + wrong +
                   "; for the same part of the sensor: mvstudio calib resize " + ShellWord(path) + sizes +
                   " option 'out' resized.json");
}

geometry::Rig GivenLenses(const std::string& path, InputNotes* notes) {
  const calib::ImportedRig given = ReadCalibrationFiles({path}, {});
  AddNotes(given.notes, notes);
  notes->inputs.push_back(path);
  return given.rig;
}

void RequireAnyLens(bool any, const std::string& library) {
  if (!any) throw UsageError(library + " has a lens of none of the cameras: check their serial in mvstudio.toml");
}

/// The library's lenses of the session's cameras.
geometry::Rig LibraryLenses(const CalibrateOptions& options, InputNotes* notes) {
  if (options.session.session.empty())
    throw UsageError("option 'lenses' finds lenses by the serial numbers of a option 'session'");
  const dataset::Session session = dataset::ReadSession(options.session.session, options.session.allow_outside);
  geometry::Rig lenses = LensesOf(ReadLensLibrary(options.lenses), session.cameras);
  notes->inputs.push_back(options.lenses);
  RequireAnyLens(!lenses.cameras.empty(), options.lenses);
  return lenses;
}

/// Starts from a given calibration, or from the library's lenses of the session's cameras, which are then held.
void FillStart(CalibrateReport* report, calib::CalibrateInput* input) {
  CalibrateOptions& options = report->options;
  if (!options.start.empty()) {
    input->start = GivenLenses(options.start, &report->notes);
    return RequireSameSizes(*input, options.start);
  }
  if (options.lenses.empty()) return;
  const geometry::Rig lenses = LibraryLenses(options, &report->notes);
  calib::HeldPart held;
  for (const calib::CameraInput& camera : input->cameras) {
    if (lenses.Find(camera.name) >= 0) held.cameras.push_back(camera.name);
  }
  RequireAnyLens(!held.cameras.empty(), options.lenses);
  report->library_lenses = held.cameras;
  options.solve.fix.push_back(held);
  input->start = lenses;
  RequireSameSizes(*input, options.lenses);
}

void CalibrateWithoutBoard(const RunContext& run, CalibrateReport* report) {
  geometry::Rig lenses;
  if (!report->options.start.empty()) lenses = GivenLenses(report->options.start, &report->notes);
  if (!report->options.lenses.empty()) {
    lenses = LibraryLenses(report->options, &report->notes);
    report->library_lenses = geometry::CameraNames(lenses);
  }
  CalibrateOnScene(lenses, run, report);
}

/// Marked points alone, without any lens: they say what the lenses are, as the corners of a board in one image do.
bool FindsLenses(const CalibrateOptions& options) {
  return !options.scene.scene_points.empty() && options.scene.from_scene.empty() && options.start.empty() &&
         options.lenses.empty();
}

bool UsesScene(const SceneOptions& options) { return !options.from_scene.empty() || !options.scene_points.empty(); }

CornerInput PointsAsCorners(CalibrateReport* report) {
  CalibrateOptions& options = report->options;
  if (options.scene.rigid) throw UsageError("option 'rigid' places a rig that is known: give it with option 'start'");
  const calib::ScenePoints points = calib::ReadScenePoints(options.scene.scene_points);
  for (const std::string& path : options.scene.scene_points) report->notes.inputs.push_back(path);
  CornerInput corners;
  corners.input = PointsAsBoard(points, options.corners.corner_files.sizes);
  calib::WorldOrigin& world = options.solve.world;
  if (!world.board_frame && world.camera.empty()) world.board_frame = 0;
  return corners;
}

/// The world of the calibration that is replaced, unless another one is asked for.
std::optional<EarlierWorld> FillWorld(const CornerInput& corners, CalibrateOptions* options) {
  calib::WorldOrigin& world = options->solve.world;
  if (world.board_frame || !world.camera.empty() || !options->start.empty() || options->solve.intrinsics_only) return {};
  std::optional<EarlierWorld> earlier = FindEarlierWorld(options->out, options->corners, corners);
  if (earlier && earlier->why_lost.empty()) world.board_frame = earlier->gauge.frame;
  return earlier;
}

/// Cameras of the session whose footage is to be calibrated that the board's take lacks.
std::vector<calib::LeftOutCamera> NotFilmed(const CalibrateOptions& options) {
  std::vector<calib::LeftOutCamera> cameras;
  if (options.session.session.empty() || !CornerPaths(options.corners).empty()) return {};
  for (const std::string& name : CamerasWithoutBoard(options.session)) cameras.push_back({name, kNotFilmed});
  return cameras;
}

std::string WriteBoardPoses(const calib::CalibrateReport& solved, const std::string& folder) {
  const std::string poses = BoardPosesCsv(solved), path = folder + "/" + kBoardPosesFile;
  if (poses.empty()) return "";
  WriteFileAtomic(path, poses);
  return path;
}

void WriteBoardFiles(const RunContext& run, BoardCalibration* found, CalibrateReport* report) {
  const calib::CalibrateReport& solved = found->solved.report;
  const std::string& out = report->options.out;
  report->path = out + "/calibration.json";
  {
    FilesTogether together;
    geometry::WriteRig(solved.rig, report->path);
    if (!FindsLenses(report->options)) found->poses_path = WriteBoardPoses(solved, out);
    together.Commit();
  }
  found->views = WriteBoardViews(report->options.corners, solved, found->solved.kept, out, run);
}

/// What is done with corners before they are solved.
void PrepareBoards(CalibrateReport* report, CornerInput* corners, std::vector<int>* front_of) {
  const CalibrateOptions& options = report->options;
  RequireSizes(*corners, FindsLenses(options) ? options.scene.scene_points[0] : options.corners.corners);
  if (!options.save_corners.empty()) SaveCorners(*corners, options.save_corners, report->notes);
  *front_of = calib::PartSides(&corners->input);
  FillStart(report, &corners->input);
}

void ChooseOnBoards(double started_s, const RunContext& run, CalibrateReport* report) {
  const auto prepare = [](CalibrateReport* trial, CornerInput* corners) {
    std::vector<int> ignored;
    trial->options.save_corners.clear();
    PrepareBoards(trial, corners, &ignored);
  };
  ChooseCalibration(started_s, prepare, run, report);
}

void CalibrateOnBoards(double started_s, const RunContext& run, CalibrateReport* report) {
  CalibrateOptions& options = report->options;
  BoardCalibration& found = std::get<BoardCalibration>(report->found);
  const bool from_points = FindsLenses(options);
  const std::vector<calib::LeftOutCamera> not_filmed = NotFilmed(options);
  if (!from_points) FillCorners(options.session, &options.corners, &report->notes);
  FillTimeline(&options.corners, &report->notes);
  options.corners.footage.all_cameras = false;
  if (options.budget.Asked()) ChooseOnBoards(started_s, run, report);
  const Stopwatch watch;
  CornerInput& corners = found.corners;
  corners = from_points ? PointsAsCorners(report) : ReadCornerInput(options.corners, run, &report->notes);
  PrepareBoards(report, &corners, &found.front_of);
  found.earlier_world = FillWorld(corners, &options);
  found.solved = CalibrateSolvable(corners.input, options.solve, run);
  geometry::RigGauge& gauge = found.solved.report.rig.gauge;
  if (from_points && gauge == geometry::RigGauge::OfBoard(0)) gauge = {geometry::RigGauge::Kind::kPoints};
  if (found.solved.report.status != Status::kOk) return;
  std::vector<calib::LeftOutCamera>& left_out = found.solved.left_out;
  left_out.insert(left_out.end(), not_filmed.begin(), not_filmed.end());
  NameLeftOut(left_out, &found.solved.report.verdict);
  WriteBoardFiles(run, &found, report);
  found.wall_s = watch.Seconds();
  if (!from_points) found.film_gain = PredictGain(found.solved.report, corners.input.boards);
  found.behind_sigmas_mm = BehindSigmasMm(found.solved.report, corners.input.boards);
}

void CheckBudget(const CalibrateOptions& options) {
  (void)options.budget.BudgetSeconds();  // what it cannot be must not cost the run
  const std::optional<ErrorTarget> target = options.budget.Target();
  if (target && target->unit != ErrorUnit::kPx)
    throw UsageError("option 'target' " + options.budget.target + ": a calibration has its held-out error in px");
  if (options.budget.Asked() && UsesScene(options.scene))
    throw UsageError("option 'budget' and option 'target' choose among settings for boards: leave them out without a board");
}

}  // namespace

CalibrateReport RunCalibrate(CalibrateOptions options, const RunContext& run) {
  const double started_s = options.budget.NowSeconds();
  if (options.out.empty() && !options.session.session.empty()) options.out = options.session.session + "/calib";
  if (options.out.empty()) throw UsageError("option 'out' is required, or a option 'session' to write to");
  CheckBudget(options);
  std::vector<std::string> names = {"calibration.json", kBoardPosesFile, kBoardViewsFolder};
  if (!options.scene.from_scene.empty()) names.push_back("colmap");
  std::vector<std::string> inputs = CornerPaths(options.corners);
  inputs.insert(inputs.end(), {options.start, options.scene.from_scene});
  const OutputFolder place(options.out, inputs, names);
  CalibrateReport report;
  report.options = std::move(options);
  if (UsesScene(report.options.scene) && !FindsLenses(report.options)) {
    CalibrateWithoutBoard(run, &report);
  } else {
    CalibrateOnBoards(started_s, run, &report);
  }
  if (report.budget) KeepCalibrationOutcome(started_s, &report);
  return report;
}

}  // namespace mvstudio::stages
