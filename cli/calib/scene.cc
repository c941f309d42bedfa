#include "cli/calib/scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "calib/board/sides.h"
#include "calib/detect/detect_board.h"
#include "calib/keypoints/place_marks.h"
#include "cli/calib/stated_lengths.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "core/units.h"
#include "dataset/footage/image_io.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/calibration_use.h"
#include "stages/input/calib_read.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

void WriteCalibration(const geometry::Rig& rig, const std::string& out, CommandResult* result) {
  result->folder = out;
  const std::string path = out + "/calibration.json";
  geometry::WriteRig(rig, path);
  result->outputs.push_back({path, "calibration"});
}

ordered_json PoseMetrics(const geometry::RigCamera& camera) {
  const stages::CameraSigmas sigmas = stages::SigmasOf(camera);
  ordered_json json;
  json["name"] = camera.camera.name;
  json["model"] = std::string(geometry::ToString(camera.camera.model));
  json["focal_px"] = FiniteOrNull((camera.camera.fx() + camera.camera.fy()) / 2);
  json["focal_sigma_px"] = FiniteOrNull(sigmas.focal_px);
  json["rotation_sigma_deg"] = FiniteOrNull(RadToDeg(sigmas.rotation_rad));
  json["position_sigma_mm"] = FiniteOrNull(1e3 * sigmas.position_m);
  return json;
}

void AddGross(const std::string& where, const std::vector<std::string>& gross, CommandResult* result) {
  for (const std::string& point : gross)
    result->warnings.push_back({"CAL-CLICK", where + point + " off, left out", "mark it again, or check its coordinates"});
}

CommandResult Failed(CommandResult result, Status status, const std::string& message) {
  result.exit = kExitIllPosed;
  result.metrics["status"] = std::string(ToString(status));
  result.errors.push_back({"CAL-UNSOLVED", message, "status " + std::string(ToString(status))});
  return result;
}

/// Marks without places: the cameras by one another, and the size by lengths. The world is that of the first camera.
CommandResult RunMarks(const SceneArguments& arguments, const geometry::Rig& lenses, const std::string& out,
                       CommandResult result) {
  if (arguments.rigid) throw UsageError("--rigid needs marks with places, --length is for marks without: give one of them");
  const calib::ScenePoints marks = calib::ReadMarks(arguments.scene_points);
  result.inputs.insert(result.inputs.end(), arguments.scene_points.begin(), arguments.scene_points.end());
  if (marks.x_in_world.cols() > 0 && marks.x_in_world.array().isFinite().any())
    throw UsageError("--length is for marks without places, and these have some: they give the size, leave out --length");
  const auto lengths = LengthsOf(calib::ParseStatedLengths(arguments.lengths), marks.names);
  calib::MarkedRig placed = PlaceFromMarks(lenses, marks, arguments.points.click_sigma_px);
  if (placed.status != Status::kOk) return Failed(std::move(result), placed.status, placed.message);
  AddGross("click ", placed.gross, &result);
  const calib::LengthScale scale = ScaleFromLengths(lengths, {placed.points});
  DescribeLengths(scale, &result);
  if (scale.status != Status::kOk) return result;
  placed.rig = geometry::InWorld(placed.rig, {}, scale.scale);
  placed.rig.gauge.stated_lengths = true;
  result.metrics["gauge"] = GaugeText(placed.rig.gauge);
  result.metrics["rms_px"] = FiniteOrNull(placed.rms_px);
  result.metrics["cameras"] = ordered_json::array();
  std::string lines;
  for (size_t c = 0; c < placed.rig.cameras.size(); ++c) {
    ordered_json json = PoseMetrics(placed.rig.cameras[c]);
    json["num_points"] = placed.num_clicks[c], json["num_used"] = placed.num_used[c];
    lines +=
        Format("%-16s %d of %d marks\n", placed.rig.cameras[c].camera.name.c_str(), placed.num_used[c], placed.num_clicks[c]);
    result.metrics["cameras"].push_back(json);
  }
  result.text =
      lines +
      Format("%zu marks, rms %.2f px, world: %s\n", placed.points.size(), placed.rms_px, GaugeText(placed.rig.gauge).c_str()) +
      result.text;
  result.warnings.push_back({"CAL-WORLD", "the world is that of " + placed.rig.cameras[0].camera.name,
                             "mvstudio calib align --floor-joints, or --floor-board, sets the floor"});
  WriteCalibration(placed.rig, out, &result);
  stages::WarnOfCovariance(placed.rig, &result);
  return result;
}

CommandResult RunScenePoints(const SceneArguments& arguments, const geometry::Rig& lenses, const std::string& out,
                             CommandResult result) {
  if (lenses.cameras.empty())
    throw UsageError(
        "--scene-points places cameras whose lenses are known: give their calibration with --start, or --lenses of a "
        "--session");
  if (!arguments.lengths.empty()) return RunMarks(arguments, lenses, out, std::move(result));
  const calib::ScenePoints points = calib::ReadScenePoints(arguments.scene_points);
  result.inputs.insert(result.inputs.end(), arguments.scene_points.begin(), arguments.scene_points.end());
  const calib::SceneResectionReport report = calib::ResectScene(points, lenses, arguments.rigid, arguments.points);
  result.metrics["gauge"] = GaugeText(report.rig.gauge);
  result.metrics["cameras"] = ordered_json::array();
  int failed = 0;
  std::string reason;
  for (const auto& camera : report.cameras) {
    const calib::PointResection& r = camera.resection;
    const bool ok = r.status == Status::kOk;
    ordered_json json{{"name", camera.name}, {"status", std::string(ToString(r.status))}, {"num_points", camera.num_clicks}};
    if (ok) {
      json["num_used"] = r.num_used, json["rms_px"] = FiniteOrNull(r.rms_px),
      json["leave_one_out_px"] = FiniteOrNull(r.leave_one_out_px);
      json["lens"] = r.lens_reason;
      result.text += Format("%-16s %d of %d points, rms %.2f px, left-out points %.2f px\n", camera.name.c_str(), r.num_used,
                            camera.num_clicks, r.rms_px, r.leave_one_out_px);
    } else {
      ++failed;
      reason = camera.name + ": " + r.message;
      result.text += camera.name + " " + r.message + "\n";
      result.errors.push_back({"CAL-UNSOLVED", reason, "mark more points, spread over the image and in depth"});
    }
    AddGross("camera " + camera.name + ": point ", camera.gross, &result);
    result.metrics["cameras"].push_back(json);
  }
  result.metrics["poses"] = ordered_json::array();
  for (const geometry::RigCamera& camera : report.rig.cameras) result.metrics["poses"].push_back(PoseMetrics(camera));
  if (report.rig.cameras.empty()) {
    result.exit = kExitIllPosed;
    return result;
  }
  WriteCalibration(report.rig, out, &result);
  stages::WarnOfCovariance(report.rig, &result, report.given_unknown);
  if (failed > 0) result.exit = kExitPartial;
  return result;
}

std::vector<calib::SceneImage> FindImages(const SceneArguments& arguments, const geometry::Rig& lenses, CommandResult* result) {
  std::vector<calib::SceneImage> images;
  std::set<std::string> names;
  for (const std::string& path : FilesMatching(arguments.from_scene)) {
    const std::filesystem::path file(path);
    std::string extension = file.extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") continue;
    const std::string name = file.stem().string();
    if (!names.insert(name).second) throw UsageError("--from-scene: two images are named " + name + "; each camera has one");
    const Image picture = dataset::ReadImage(path, true);
    const int known = lenses.Find(name);
    calib::SceneImage image{
        name, path,
        known >= 0 ? lenses.cameras[static_cast<size_t>(known)].camera : calib::GuessLens(name, picture.width, picture.height),
        known >= 0, known >= 0 ? lenses.cameras[static_cast<size_t>(known)].params_covariance : std::nullopt};
    if (image.lens.width_px != picture.width || image.lens.height_px != picture.height)
      throw UsageError(path + " has another size than the calibration of camera " + name + " says");
    images.push_back(image);
    result->inputs.push_back(path);
  }
  if (images.size() < 2)
    throw UsageError("--from-scene " + arguments.from_scene + ": at least two images (PNG or JPEG) are needed");
  return images;
}

calib::KnownPoints FindBoard(const calib::Board& board, const std::vector<calib::SceneImage>& images) {
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
    throw UsageError("--from-scene: the board is seen by " + std::to_string(detections.size()) +
                     " cameras; two are needed for the scale");
  calib::KnownPoints known = calib::KnownFromBoard(board, detections, names);
  known.gauge.frame.reset();  // every camera has one image
  return known;
}

calib::SceneScale FindScale(const SceneArguments& arguments, const std::vector<calib::Board>& boards,
                            const std::vector<calib::SceneImage>& images, CommandResult* result) {
  calib::RequireThickness(boards);
  calib::SceneScale scale;
  if (!arguments.camera_distance.empty()) {
    scale.distance = calib::ParseCameraDistance(arguments.camera_distance);
    for (const std::string& name : {scale.distance->a, scale.distance->b}) {
      if (std::none_of(images.begin(), images.end(), [&](const calib::SceneImage& image) { return image.camera == name; }))
        throw UsageError("--camera-distance: there is no image of a camera '" + name + "'");
    }
  }
  if (!arguments.scene_points.empty()) {
    scale.points = calib::KnownFromScenePoints(calib::ReadScenePoints(arguments.scene_points), arguments.points.click_sigma_px);
    result->inputs.insert(result->inputs.end(), arguments.scene_points.begin(), arguments.scene_points.end());
  } else if (!boards.empty()) {
    scale.points = FindBoard(boards[0], images);
  }
  if (!scale.points && !scale.distance)
    throw UsageError(
        "--from-scene: images do not show the scale; give --board, --scene-points or --camera-distance A:B:LENGTH");
  return scale;
}

CommandResult RunFromScene(const SceneArguments& arguments, const geometry::Rig& lenses,
                           const std::vector<calib::Board>& boards, const std::string& out, CommandContext& context,
                           CommandResult result) {
  const std::vector<calib::SceneImage> images = FindImages(arguments, lenses, &result);
  const calib::SceneScale scale = FindScale(arguments, boards, images, &result);
  const calib::ColmapScene scene = calib::RunColmap(images, out + "/colmap", arguments.scene.colmap, context.run);
  const calib::FromSceneReport report = calib::AdjustScene(scene, images, scale, arguments.scene, context.run);
  if (report.status != Status::kOk) return Failed(std::move(result), report.status, report.message);
  result.metrics["gauge"] = GaugeText(report.rig.gauge);
  result.metrics["rms_px"] = FiniteOrNull(report.bundle.rms_px);
  result.metrics["feature_sigma_px"] = FiniteOrNull(report.feature_sigma_px);
  result.metrics["own_lenses"] = report.own_lenses;
  result.metrics["variance_factor"] = FiniteOrNull(report.clusters.factor);
  result.metrics["num_points"] = report.num_points;
  result.metrics["num_features"] = report.bundle.num_observations;
  result.metrics["num_rejected"] = report.bundle.num_rejected;
  result.metrics["missing"] = report.missing;
  result.metrics["cameras"] = ordered_json::array();
  for (size_t c = 0; c < report.rig.cameras.size(); ++c) {
    ordered_json json = PoseMetrics(report.rig.cameras[c]);
    json["num_features"] = report.num_seen[c];
    result.metrics["cameras"].push_back(json);
    const stages::CameraSigmas sigmas = stages::SigmasOf(report.rig.cameras[c]);
    result.text += Format("%-16s focal %9.2f px, %5d features, position +- %.2f mm, rotation +- %.4f deg\n",
                          report.rig.cameras[c].camera.name.c_str(), report.rig.cameras[c].camera.fx(), report.num_seen[c],
                          1e3 * sigmas.position_m, RadToDeg(sigmas.rotation_rad));
  }
  result.text += Format("%d points, %d features kept, %d rejected, feature sigma %.3f px, world: %s\n", report.num_points,
                        report.bundle.num_observations, report.bundle.num_rejected, report.feature_sigma_px,
                        GaugeText(report.rig.gauge).c_str());
  constexpr double kMisfit = 10;
  if (report.clusters.factor > kMisfit) {
    result.warnings.push_back(
        {"CAL-MISFIT",
         Format("neighbouring features err together: variances are %.0f times those of independent errors",
                report.clusters.factor),
         "the lens model does not fit: give the lenses with --start"});
  }
  AddGross("", report.gross, &result);
  WriteCalibration(report.rig, out, &result);
  stages::WarnOfCovariance(report.rig, &result);
  for (const std::string& camera : report.missing) {
    result.exit = kExitPartial;
    result.errors.push_back({"CAL-UNPLACED", "camera " + camera + " shares too few features with the others",
                             "more texture where its view meets another's, or a camera in between"});
  }
  return result;
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

CommandResult RunScene(const SceneArguments& arguments, const geometry::Rig& lenses, const std::vector<calib::Board>& boards,
                       const std::string& out, CommandContext& context, CommandResult result) {
  if (!arguments.lengths.empty() && (arguments.scene_points.empty() || !arguments.from_scene.empty()))
    throw UsageError("--length gives marks without places their size: it needs --scene-points alone");
  if (arguments.from_scene.empty() && !boards.empty())
    throw UsageError("--scene-points without --from-scene places cameras by their marks alone: leave out --board");
  if (arguments.from_scene.empty()) return RunScenePoints(arguments, lenses, out, std::move(result));
  return RunFromScene(arguments, lenses, boards, out, context, std::move(result));
}

}  // namespace mvstudio::cli
