#include "calib/points/align_rig.h"

#include <algorithm>
#include <cmath>

#include "calib/board/floor.h"
#include "calib/bundle/board_shape.h"
#include "calib/formats/csv_table.h"
#include "calib/points/from_scene.h"
#include "core/error.h"
#include "core/format.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::calib {
namespace {

constexpr double kCornerSigmaPx = 0.3;

/// The corners of the board in the frame as points of the world that the board defines.
ScenePoints PointsOfBoard(const geometry::Rig& rig, const CalibrateInput& input, int64_t frame) {
  ScenePoints points;
  const geometry::Rigid3 world_from_board = WorldFromFloorBoard();
  points.x_in_world = ShapedCorners(input.boards.at(0), rig.boards);
  for (Eigen::Index i = 0; i < points.x_in_world.cols(); ++i) {
    points.x_in_world.col(i) = world_from_board * Eigen::Vector3d(points.x_in_world.col(i));
    points.names.push_back("corner " + std::to_string(i));
  }
  for (const Detection& detection : input.detections) {
    const std::string& name = input.cameras[static_cast<size_t>(detection.camera_idx)].name;
    if (detection.frame_idx != frame || detection.board_idx != 0 || rig.Find(name) < 0) continue;
    const int camera = static_cast<int>(points.cameras.size());
    points.cameras.push_back(name);
    for (int i = 0; i < detection.num_corners(); ++i)
      points.clicks.push_back({camera, detection.corner_ids[static_cast<size_t>(i)], detection.points_px.col(i)});
  }
  return points;
}

RigAlignment PlaceRigid(const geometry::Rig& rig, const ScenePoints& points, const PointResectionOptions& options) {
  RigAlignment out;
  const SceneResectionReport report = ResectScene(points, rig, true, options);
  const PointResection& placed = report.cameras.at(0).resection;
  out.num_points = static_cast<int>(points.clicks.size()), out.num_used = placed.num_used;
  out.status = placed.status, out.message = placed.message, out.rms_px = placed.rms_px;
  out.gross = report.cameras[0].gross, out.unknown = report.given_unknown;
  if (out.status != Status::kOk) return out;
  out.new_from_old = geometry::Inverse(placed.rig_from_world);
  out.rig = report.rig, out.rig.boards = rig.boards;
  for (size_t c = 0; c < rig.cameras.size(); ++c) out.rig.cameras[c].time_offset = rig.cameras[c].time_offset;
  return out;
}

RigAlignment Refuse(Status status, const std::string& message, int num_points) {
  RigAlignment out;
  out.status = status, out.message = message, out.num_points = num_points;
  return out;
}

RigAlignment Moved(const geometry::Rig& rig, const geometry::Rigid3& new_from_old, double scale) {
  RigAlignment out;
  out.new_from_old = new_from_old, out.scale = scale;
  out.rig = geometry::InWorld(rig, new_from_old, scale);
  out.rig.gauge = geometry::GaugeAfterMove({geometry::RigGauge::Kind::kPoints}, rig.gauge);
  return out;
}

/// True when a reflection brings the points far closer than any motion does.
bool Mirrored(const PlacePairs& pairs, double rms_m, bool with_scale) {
  Eigen::Matrix3Xd reflected = pairs.x_in_new;
  reflected.row(2) *= -1;
  const geometry::Alignment mirror = geometry::AlignPoints(pairs.x_in_old, reflected, with_scale);
  constexpr double kFar = 10;
  return mirror.status == Status::kOk && rms_m > 1e-4 && rms_m > kFar * mirror.rms;
}

}  // namespace

RigAlignment AlignToBoard(const geometry::Rig& rig, const CalibrateInput& input, int64_t frame) {
  const ScenePoints points = PointsOfBoard(rig, input, frame);
  if (points.clicks.empty()) throw UsageError("no camera of the calibration sees the board in frame " + std::to_string(frame));
  const int side = input.boards.at(0).num_side_corners();
  const bool back =
      std::any_of(points.clicks.begin(), points.clicks.end(), [&](const auto& click) { return click.point_idx >= side; });
  if (back)
    return Refuse(Status::kDegenerate,
                  "the board shows its back in frame " + std::to_string(frame) + ": name one where it lies face up",
                  static_cast<int>(points.clicks.size()));
  PointResectionOptions options;
  options.click_sigma_px = kCornerSigmaPx;
  RigAlignment out = PlaceRigid(rig, points, options);
  out.rig.gauge = geometry::RigGauge::OfBoard(frame);
  return out;
}

RigAlignment AlignToClicks(const geometry::Rig& rig, const ScenePoints& points, bool with_scale,
                           const PointResectionOptions& options) {
  if (!with_scale) return PlaceRigid(rig, points, options);
  const SceneSimilarity similarity = AlignScene(rig, KnownFromScenePoints(points, options.click_sigma_px));
  if (similarity.status != Status::kOk) return Refuse(similarity.status, similarity.message, similarity.num_points);
  RigAlignment out = Moved(rig, similarity.world_from_scene, similarity.scale);
  out.num_points = out.num_used = similarity.num_points, out.rms_m = similarity.rms_m;
  return out;
}

bool HasPlacePairs(const std::string& path) { return CsvTable(path).Find({"x_old"}) >= 0; }

bool HasClicks(const std::string& path) {
  const CsvTable table(path);
  return table.Find({"camera"}) >= 0 && table.Find({"point", "name"}) >= 0;
}

PlacePairs ReadPlacePairs(const std::string& path) {
  const CsvTable table(path);
  PlacePairs pairs;
  const auto count = static_cast<Eigen::Index>(table.num_rows());
  pairs.x_in_old.resize(3, count), pairs.x_in_new.resize(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto row = static_cast<size_t>(i);
    const auto number = [&](const char* column) { return table.Number(row, table.Require({column})); };
    pairs.names.push_back(table.Text(row, table.Require({"point", "name"})));
    pairs.x_in_new.col(i) << number("x"), number("y"), number("z");
    pairs.x_in_old.col(i) << number("x_old"), number("y_old"), number("z_old");
  }
  return pairs;
}

RigAlignment AlignToPlaces(const geometry::Rig& rig, const PlacePairs& pairs, bool with_scale) {
  const geometry::Alignment found = geometry::AlignPoints(pairs.x_in_old, pairs.x_in_new, with_scale);
  const int count = static_cast<int>(pairs.names.size());
  if (found.status == Status::kTooFewViews)
    return Refuse(found.status, std::to_string(count) + " points are given; at least 3 are needed", count);
  if (found.status != Status::kOk) return Refuse(found.status, "the points lie on one line", count);
  if (Mirrored(pairs, found.rms, with_scale))
    return Refuse(Status::kDegenerate, "the points are mirrored: one of the two worlds is left-handed", count);
  RigAlignment out = Moved(rig, found.b_from_a, found.scale);
  out.num_points = out.num_used = count, out.rms_m = found.rms;
  for (Eigen::Index i = 0; i < pairs.x_in_old.cols(); ++i) {
    const Eigen::Vector3d at = found.scale * (found.b_from_a.rotation * pairs.x_in_old.col(i)) + found.b_from_a.translation;
    const double off_m = (at - pairs.x_in_new.col(i)).norm();
    constexpr double kGross = 2.5;  // of n points one alone can be off by sqrt(n) times the rms
    if (count > 6 && off_m > kGross * found.rms)
      out.gross.push_back(Format("%s: %.3g mm", pairs.names[static_cast<size_t>(i)].c_str(), 1e3 * off_m));
  }
  return out;
}

}  // namespace mvstudio::calib
