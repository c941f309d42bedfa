#include "stages/calibrate/scene.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <set>

#include "calib/board/sides.h"
#include "calib/detect/detect_board.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "geometry/rig/rig_io.h"
#include "stages/input/calib_read.h"

namespace mvstudio::stages {
namespace {

void WriteSolved(const geometry::Rig& rig, CalibrateReport* report) {
  report->path = report->options.out + "/calibration.json";
  geometry::WriteRig(rig, report->path);
}

void NoteScenePoints(CalibrateReport* report) {
  const std::vector<std::string>& paths = report->options.scene.scene_points;
  report->notes.inputs.insert(report->notes.inputs.end(), paths.begin(), paths.end());
}

/// Marks without places: the cameras by one another, and the size by lengths. The world is that of the first camera.
void PlaceByMarks(const geometry::Rig& lenses, CalibrateReport* report) {
  const SceneOptions& options = report->options.scene;
  if (options.rigid)
    throw UsageError("option 'rigid' needs marks with places, option 'length' is for marks without: give one of them");
  const calib::ScenePoints marks = calib::ReadMarks(options.scene_points);
  NoteScenePoints(report);
  if (marks.x_in_world.cols() > 0 && marks.x_in_world.array().isFinite().any()) {
    throw UsageError(
        "option 'length' is for marks without places, and these have some: they give the size, leave out option 'length'");
  }
  const auto lengths = LengthsOf(calib::ParseStatedLengths(options.lengths), marks.names);
  MarkedCalibration& found = report->found.emplace<MarkedCalibration>();
  found.placed = PlaceFromMarks(lenses, marks, options.points.click_sigma_px);
  if (found.placed.status != Status::kOk) return;
  found.scale = ScaleFromLengths(lengths, {found.placed.points});
  if (found.scale->status != Status::kOk) return;
  found.placed.rig = geometry::InWorld(found.placed.rig, {}, found.scale->scale);
  found.placed.rig.gauge.stated_lengths = true;
  WriteSolved(found.placed.rig, report);
}

void PlaceByPoints(const geometry::Rig& lenses, CalibrateReport* report) {
  const SceneOptions& options = report->options.scene;
  if (lenses.cameras.empty()) {
    throw UsageError(
        "option 'scene-points' places cameras whose lenses are known: give their calibration with option 'start', or option "
        "'lenses' of a option 'session'");
  }
  if (!options.lengths.empty()) return PlaceByMarks(lenses, report);
  const calib::ScenePoints points = calib::ReadScenePoints(options.scene_points);
  NoteScenePoints(report);
  report->found = calib::ResectScene(points, lenses, options.rigid, options.points);
  const geometry::Rig& rig = std::get<calib::SceneResectionReport>(report->found).rig;
  if (!rig.cameras.empty()) WriteSolved(rig, report);
}

calib::SceneImage SceneImageOf(const std::string& name, const std::string& path, const geometry::Rig& lenses) {
  const Image image = dataset::ReadImage(path, true);
  const int known = lenses.Find(name);
  if (known < 0) return {name, path, calib::GuessLens(name, image.width, image.height), false, std::nullopt};
  const geometry::RigCamera& lens = lenses.cameras[static_cast<size_t>(known)];
  if (lens.camera.width_px != image.width || lens.camera.height_px != image.height)
    throw UsageError(path + " has another size than the calibration of camera " + name + " says");
  return {name, path, lens.camera, true, lens.params_covariance};
}

std::vector<calib::SceneImage> FindSceneImages(const std::string& from_scene, const geometry::Rig& lenses, InputNotes* notes) {
  std::vector<calib::SceneImage> images;
  std::set<std::string> names;
  for (const std::string& path : FilesMatching(from_scene)) {
    const std::filesystem::path file(path);
    std::string extension = file.extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") continue;
    const std::string name = file.stem().string();
    if (!names.insert(name).second)
      throw UsageError("option 'from-scene': two images are named " + name + "; each camera has one");
    images.push_back(SceneImageOf(name, path, lenses));
    notes->inputs.push_back(path);
  }
  if (images.size() < 2)
    throw UsageError("option 'from-scene' " + from_scene + ": at least two images (PNG or JPEG) are needed");
  return images;
}

calib::KnownPoints FindSceneBoard(const calib::Board& board, const std::vector<calib::SceneImage>& images) {
  std::vector<calib::Detection> detections;
  std::vector<std::string> names;
  for (size_t i = 0; i < images.size(); ++i) {
    names.push_back(images[i].camera);
    calib::BoardDetection found = calib::DetectBoard(board, dataset::ReadImage(images[i].path, true));
    if (found.status != Status::kOk) continue;
    found.detection.camera_idx = static_cast<int>(i);
    detections.push_back(found.detection);
  }
  if (detections.size() < 2)
    throw UsageError("option 'from-scene': the board is seen by " + std::to_string(detections.size()) +
                     " cameras; two are needed for the scale");
  calib::KnownPoints known = calib::KnownFromBoard(board, detections, names);
  known.gauge.frame.reset();  // every camera has one image
  return known;
}

calib::SceneScale FindSceneScale(const std::vector<calib::SceneImage>& images, CalibrateReport* report) {
  const SceneOptions& options = report->options.scene;
  const std::vector<calib::Board>& boards = report->options.corners.boards;
  calib::RequireThickness(boards);
  calib::SceneScale scale;
  if (!options.camera_distance.empty()) {
    scale.distance = calib::ParseCameraDistance(options.camera_distance);
    for (const std::string& name : {scale.distance->a, scale.distance->b}) {
      if (std::none_of(images.begin(), images.end(), [&](const calib::SceneImage& image) { return image.camera == name; }))
        throw UsageError("option 'camera-distance': there is no image of a camera '" + name + "'");
    }
  }
  if (!options.scene_points.empty()) {
    scale.points = calib::KnownFromScenePoints(calib::ReadScenePoints(options.scene_points), options.points.click_sigma_px);
    NoteScenePoints(report);
  } else if (!boards.empty()) {
    scale.points = FindSceneBoard(boards[0], images);
  }
  if (scale.points || scale.distance) return scale;
  throw UsageError(
      "option 'from-scene': images do not show the scale; give option 'board', option 'scene-points' or option "
      "'camera-distance' A:B:LENGTH");
}

void PlaceByScene(const geometry::Rig& lenses, const RunContext& run, CalibrateReport* report) {
  const SceneOptions& options = report->options.scene;
  const std::vector<calib::SceneImage> images = FindSceneImages(options.from_scene, lenses, &report->notes);
  const calib::SceneScale scale = FindSceneScale(images, report);
  const calib::ColmapScene scene = calib::RunColmap(images, report->options.out + "/colmap", options.scene.colmap, run);
  report->found = calib::AdjustScene(scene, images, scale, options.scene, run);
  const calib::FromSceneReport& found = std::get<calib::FromSceneReport>(report->found);
  if (found.status == Status::kOk) WriteSolved(found.rig, report);
}

}  // namespace

calib::CalibrateInput PointsAsBoard(const calib::ScenePoints& points, const std::vector<calib::CameraSize>& sizes) {
  calib::CalibrateInput input;
  input.boards.resize(1);
  input.boards[0].kind = calib::Board::Kind::kPoints;
  input.boards[0].points = points.x_in_world;
  for (const std::string& name : points.cameras) {
    calib::CameraInput camera{name};
    for (const calib::CameraSize& size : sizes) {
      if (size.camera.empty() || size.camera == name) camera.width_px = size.width_px, camera.height_px = size.height_px;
    }
    std::vector<calib::PointClick> clicks;
    for (const calib::PointClick& click : points.clicks) {
      if (points.cameras[static_cast<size_t>(click.camera_idx)] == name) clicks.push_back(click);
    }
    calib::Detection seen;
    seen.camera_idx = static_cast<int>(input.cameras.size());
    seen.points_px.resize(2, static_cast<Eigen::Index>(clicks.size()));
    for (size_t i = 0; i < clicks.size(); ++i) {
      seen.corner_ids.push_back(clicks[i].point_idx);
      seen.points_px.col(static_cast<Eigen::Index>(i)) = clicks[i].px;
    }
    input.cameras.push_back(camera);
    input.detections.push_back(std::move(seen));
  }
  return input;
}

void CalibrateOnScene(const geometry::Rig& lenses, const RunContext& run, CalibrateReport* report) {
  const SceneOptions& options = report->options.scene;
  if (!options.lengths.empty() && (options.scene_points.empty() || !options.from_scene.empty()))
    throw UsageError("option 'length' gives marks without places their size: it needs option 'scene-points' alone");
  if (!options.from_scene.empty()) return PlaceByScene(lenses, run, report);
  if (!report->options.corners.boards.empty()) {
    throw UsageError(
        "option 'scene-points' without option 'from-scene' places cameras by their marks alone: leave out option 'board'");
  }
  PlaceByPoints(lenses, report);
}

}  // namespace mvstudio::stages
