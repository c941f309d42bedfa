#include "calib/points/scene_points.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "calib/formats/csv_table.h"
#include "calib/formats/format_text.h"
#include "calib/points/scene_carry.h"
#include "core/error.h"
#include "core/format.h"

namespace mvstudio::calib {
namespace {

/// Collects points and clicks from tables.
class Collector {
 public:
  /// `names_suffice`: a table of names alone is one of points.
  void Add(const CsvTable& table, bool names_suffice = false) {
    const bool has_place = table.Find({"x"}) >= 0 && table.Find({"y"}) >= 0 && table.Find({"z"}) >= 0;
    const bool has_click = table.Find({"camera"}) >= 0;
    if (!has_place && !has_click && !(names_suffice && table.Find({"point", "name"}) >= 0)) {
      throw FormatError(table.path(), "header", "neither the columns camera,point,x_px,y_px nor point,x,y,z are there");
    }
    for (size_t row = 0; row < table.num_rows(); ++row) {
      const int point = Point(table.Text(row, table.Require({"point", "name"})), table, row);
      if (has_place) AddPlace(table, row, point);
      if (has_click) AddClick(table, row, point);
    }
    path_ = table.path();
  }

  bool HasPlaces() const {
    return std::any_of(places_.begin(), places_.end(), [](const Eigen::Vector3d& x) { return x.allFinite(); });
  }

  ScenePoints Finish(bool needs_clicks, bool needs_places = true) {
    if (needs_clicks && out_.clicks.empty())
      throw FormatError(path_, "", "no camera sees a point: the columns camera,point,x_px,y_px are needed");
    out_.x_in_world.resize(3, static_cast<Eigen::Index>(places_.size()));
    for (size_t i = 0; i < places_.size(); ++i) out_.x_in_world.col(static_cast<Eigen::Index>(i)) = places_[i];
    for (const PointClick& click : out_.clicks) {
      if (!needs_places || places_[static_cast<size_t>(click.point_idx)].allFinite()) continue;
      throw FormatError(
          path_, "",
          "the point '" + internal::Printable(out_.names[static_cast<size_t>(click.point_idx)]) +
              "' is clicked but has no place (point,x,y,z); clicks alone place cameras of known lenses where option 'length' "
              "gives a distance of two points");
    }
    return out_;
  }

 private:
  int Point(const std::string& name, const CsvTable& table, size_t row) {
    if (name.empty()) throw FormatError(table.path(), table.Where(row), "the point has no name");
    const auto [entry, is_new] = point_idx_.insert({name, static_cast<int>(places_.size())});
    if (is_new) {
      out_.names.push_back(name);
      places_.push_back(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
    return entry->second;
  }

  void AddPlace(const CsvTable& table, size_t row, int point) {
    const Eigen::Vector3d place(table.Number(row, table.Require({"x"})), table.Number(row, table.Require({"y"})),
                                table.Number(row, table.Require({"z"})));
    Eigen::Vector3d& known = places_[static_cast<size_t>(point)];
    if (known.allFinite() && known != place) {
      throw FormatError(table.path(), table.Where(row),
                        "the point '" + internal::Printable(out_.names[static_cast<size_t>(point)]) +
                            "' has another place in an earlier row");
    }
    known = place;
  }

  void AddClick(const CsvTable& table, size_t row, int point) {
    const std::string& camera = table.Text(row, table.Require({"camera"}));
    if (camera.empty()) throw FormatError(table.path(), table.Where(row), "the camera has no name");
    const auto [entry, is_new] = camera_idx_.insert({camera, static_cast<int>(out_.cameras.size())});
    if (is_new) out_.cameras.push_back(camera);
    if (!seen_.insert({entry->second, point}).second) {
      throw FormatError(table.path(), table.Where(row),
                        "camera " + internal::Printable(camera) + " sees the point '" +
                            internal::Printable(out_.names[static_cast<size_t>(point)]) + "' twice");
    }
    out_.clicks.push_back(
        {entry->second, point, {table.Number(row, table.Require({"x_px"})), table.Number(row, table.Require({"y_px"}))}});
  }

  ScenePoints out_;
  std::vector<Eigen::Vector3d> places_;
  std::map<std::string, int> point_idx_, camera_idx_;
  std::set<std::pair<int, int>> seen_;
  std::string path_;
};

Collector Collect(const std::vector<std::string>& paths, bool names_suffice = false) {
  Collector collector;
  for (const std::string& path : paths) collector.Add(CsvTable(path), names_suffice);
  return collector;
}

std::vector<std::string> GrossErrors(const ScenePoints& points, const std::vector<PointClick>& clicks,
                                     const PointResection& resection, const geometry::Rig& rig) {
  std::vector<std::string> gross;
  for (size_t i = 0; i < clicks.size() && i < resection.rejected.size(); ++i) {
    if (!resection.rejected[i]) continue;
    const std::string camera =
        rig.cameras.size() > 1 ? " in " + rig.cameras[static_cast<size_t>(clicks[i].camera_idx)].camera.name : "";
    gross.push_back(points.names[static_cast<size_t>(clicks[i].point_idx)] + camera + ": " +
                    Format("%.3g px", resection.residuals_px.col(static_cast<Eigen::Index>(i)).norm()));
  }
  return gross;
}

void AddCameras(const geometry::Rig& group, const PointResection& resection, geometry::Rig* rig) {
  for (size_t c = 0; c < group.cameras.size(); ++c) {
    geometry::RigCamera camera = group.cameras[c];
    camera.camera = resection.cameras[c];
    camera.cam_from_world = camera.cam_from_world * resection.rig_from_world;
    rig->cameras.push_back(camera);
  }
}

}  // namespace

ScenePoints ReadScenePoints(const std::vector<std::string>& paths) {
  if (paths.empty() || paths.size() > 2) throw UsageError("option 'scene-points' takes one file, or two: clicks and places");
  return Collect(paths).Finish(true);
}

ScenePoints ReadScenePlaces(const std::vector<std::string>& paths) {
  Collector collector = Collect(paths, true);
  return collector.Finish(false, collector.HasPlaces());
}

ScenePoints ReadMarks(const std::vector<std::string>& paths) { return Collect(paths).Finish(true, false); }

SceneResectionReport ResectScene(const ScenePoints& points, const geometry::Rig& intrinsics, bool rigid,
                                 const PointResectionOptions& options) {
  std::vector<int> rig_idx;
  for (const std::string& name : points.cameras) {
    rig_idx.push_back(intrinsics.Find(name));
    if (rig_idx.back() < 0)
      throw UsageError("option 'scene-points' names the camera '" + name + "', which the intrinsics do not have");
  }
  SceneResectionReport report;
  report.rig.gauge.kind = geometry::RigGauge::Kind::kPoints;
  PlacedCovariance covariance(intrinsics, rigid);
  const auto solve = [&](const std::string& name, const geometry::Rig& group, const std::vector<size_t>& indices,
                         const std::vector<PointClick>& clicks) {
    const PointResection resection = ResectFromPoints(group.cameras, clicks, points.x_in_world, options);
    report.cameras.push_back({name, resection, static_cast<int>(clicks.size()), GrossErrors(points, clicks, resection, group)});
    if (resection.status != Status::kOk) return;
    AddCameras(group, resection, &report.rig);
    covariance.Add(indices, resection);
  };
  const auto finish = [&] {
    if (!report.rig.cameras.empty()) geometry::StoreCovariance(covariance.Joint(), &report.rig);
    report.given_unknown = covariance.unknown();
    return report;
  };
  if (rigid) {
    std::vector<PointClick> clicks = points.clicks;
    for (PointClick& click : clicks) click.camera_idx = rig_idx[static_cast<size_t>(click.camera_idx)];
    std::vector<size_t> all(intrinsics.cameras.size());
    std::iota(all.begin(), all.end(), size_t{0});
    solve("rig", intrinsics, all, clicks);
    return finish();
  }
  for (size_t c = 0; c < intrinsics.cameras.size(); ++c) {
    geometry::Rig group;
    group.cameras = {intrinsics.cameras[c]};
    group.cameras[0].cam_from_world = geometry::Rigid3();
    std::vector<PointClick> clicks;
    for (const PointClick& click : points.clicks) {
      if (rig_idx[static_cast<size_t>(click.camera_idx)] == static_cast<int>(c))
        clicks.push_back({0, click.point_idx, click.px});
    }
    if (!clicks.empty()) solve(intrinsics.cameras[c].camera.name, group, {c}, clicks);
  }
  return finish();
}

}  // namespace mvstudio::calib
