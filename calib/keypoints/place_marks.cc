#include "calib/keypoints/place_marks.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "calib/keypoints/bundle.h"
#include "calib/keypoints/marked_clicks.h"
#include "calib/points/point_bundle.h"
#include "core/format.h"
#include "geometry/rig/rig_covariance.h"
#include "triangulate/point/point.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr size_t kFewestPerCamera = 5;
constexpr double kRejectSigmas = 4.5;

/// Points that the placed cameras triangulate.
std::map<int, Eigen::Vector3d> Triangulated(const MarkedClicks& clicked, const geometry::Rig& rig,
                                            const std::set<size_t>& placed) {
  const triangulate::PreparedRig prepared = triangulate::Prepare(rig);
  std::map<int, std::vector<triangulate::Observation>> seen;
  for (const size_t c : placed)
    for (const auto& [point, observation] : clicked.observations[c])
      seen[point].push_back({static_cast<int>(c), observation.px, clicked.sigma_px, 1});
  std::map<int, Eigen::Vector3d> points;
  for (const auto& [point, observations] : seen) {
    if (observations.size() < 2) continue;
    const triangulate::Point found = triangulate::TriangulatePoint(prepared, observations);
    if (found.status == Status::kOk) points[point] = found.x_in_world;
  }
  return points;
}

/// A rig that is adjusted to the clicks, from one start.
struct Solution {
  Status status = Status::kTooFewViews;
  std::string message;
  PointScene scene;
  std::vector<int> points;  // of the marks
  std::vector<PointObservation> observations;
  PointBundleOptions options;
  PointBundleReport bundle;
  double cost = 0;  // a click that was left out costs the limit
};

/// The camera that shares most points with those that are placed.
size_t Next(const MarkedClicks& clicked, const std::set<size_t>& placed, const std::map<int, Eigen::Vector3d>& points) {
  size_t best = 0;
  std::ptrdiff_t most = -1;
  for (size_t c = 0; c < clicked.observations.size(); ++c) {
    const auto shared = std::count_if(points.begin(), points.end(),
                                      [&](const auto& point) { return clicked.observations[c].count(point.first) > 0; });
    if (!placed.count(c) && shared > most) best = c, most = shared;
  }
  return best;
}

PointResection Resect(const MarkedClicks& clicked, size_t c, const std::map<int, Eigen::Vector3d>& points) {
  std::vector<PointClick> clicks;
  Eigen::Matrix3Xd x(3, static_cast<Eigen::Index>(points.size()));
  for (const auto& [point, place] : points) {
    const auto observation = clicked.observations[c].find(point);
    if (observation == clicked.observations[c].end()) continue;
    const auto i = static_cast<int>(clicks.size());
    clicks.push_back({0, i, observation->second.px}), x.col(i) = place;
  }
  PointResection few;
  few.status = Status::kTooFewViews;
  few.message = Format("it shares %zu marks with the cameras that are placed; %zu are needed", clicks.size(), kFewestPerCamera);
  if (clicks.size() < kFewestPerCamera) return few;
  PointResectionOptions options;
  options.click_sigma_px = clicked.sigma_px;
  const geometry::RigCamera camera{clicked.rig.cameras[c].camera, Rigid3(), std::nullopt, std::nullopt};
  return ResectFromPoints({camera}, clicks, x.leftCols(static_cast<Eigen::Index>(clicks.size())), options);
}

void Adjust(const MarkedClicks& clicked, const RelativeStart& seed, const geometry::Rig& rig,
            const std::map<int, Eigen::Vector3d>& points, Solution* out) {
  const Rigid3 first = rig.cameras[0].cam_from_world, world = geometry::Inverse(first);
  out->scene.points.resize(3, static_cast<Eigen::Index>(points.size()));
  std::map<int, int> index;
  for (const auto& [point, x] : points) {
    out->scene.points.col(static_cast<Eigen::Index>(index.size())) = first * x;
    index.emplace(point, static_cast<int>(index.size())), out->points.push_back(point);
  }
  const double weight = 1 / (clicked.sigma_px * clicked.sigma_px);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    out->scene.lenses.push_back(rig.cameras[c].camera), out->scene.lens_of_camera.push_back(static_cast<int>(c));
    out->scene.cam_from_world.push_back(rig.cameras[c].cam_from_world * world);
    for (const auto& [point, observation] : clicked.observations[c])
      if (index.count(point)) out->observations.push_back({static_cast<int>(c), index.at(point), observation.px, weight});
  }
  out->options.fix_camera.assign(rig.cameras.size(), false), out->options.fix_camera[0] = true;
  out->options.distance = KnownDistance{static_cast<int>(seed.a), static_cast<int>(seed.b), 1, 1e-6};
  out->options.min_sigma = 1, out->options.reject_sigmas = kRejectSigmas;
  out->bundle = SolvePointBundle(&out->scene, &out->observations, out->options);
  out->status = out->bundle.status, out->message = out->bundle.message;
  size_t all = 0;
  for (const auto& observations : clicked.observations) all += observations.size();
  const double lost = static_cast<double>(all) - (out->bundle.num_observations);
  out->cost = out->bundle.cost + kRejectSigmas * kRejectSigmas * std::max(0.0, lost);
}

Solution Complete(const MarkedClicks& clicked, const RelativeStart& seed) {
  Solution out;
  geometry::Rig rig = clicked.rig;
  rig.cameras[seed.b].cam_from_world = seed.b_from_a;
  std::set<size_t> placed = {seed.a, seed.b};
  std::map<int, Eigen::Vector3d> points = Triangulated(clicked, rig, placed);
  while (placed.size() < rig.cameras.size()) {
    const size_t c = Next(clicked, placed, points);
    const PointResection pose = Resect(clicked, c, points);
    out.status = pose.status, out.message = "camera " + rig.cameras[c].camera.name + " cannot be placed: " + pose.message;
    if (pose.status != Status::kOk) return out;
    rig.cameras[c].cam_from_world = pose.rig_from_world;
    placed.insert(c);
    points = Triangulated(clicked, rig, placed);
  }
  Adjust(clicked, seed, rig, points, &out);
  return out;
}

/// Whether two solutions are arrangements of their own: the turn between some two cameras differs.
bool Differ(const Solution& a, const Solution& b) {
  constexpr double kRad = 0.05;
  for (size_t c = 1; c < a.scene.cam_from_world.size(); ++c)
    if (a.scene.cam_from_world[c].rotation.angularDistance(b.scene.cam_from_world[c].rotation) > kRad) return true;
  return false;
}

std::string WhyTooFew(const MarkedClicks& clicked, const Solution& solution) {
  std::vector<size_t> kept(clicked.rig.cameras.size(), 0);
  std::set<int> points;
  size_t all = 0;
  for (const PointObservation& o : solution.observations)
    if (o.weight > 0) kept[static_cast<size_t>(o.camera_idx)] += 1, points.insert(o.point_idx), ++all;
  for (size_t c = 0; c < kept.size(); ++c) {
    if (kept[c] < kFewestPerCamera)
      return Format("camera %s keeps %zu marks that agree with the others; %zu are needed",
                    clicked.rig.cameras[c].camera.name.c_str(), kept[c], kFewestPerCamera);
  }
  const auto left = static_cast<int>(2 * all) - static_cast<int>(3 * points.size() + 6 * kept.size() - 7);
  if (left >= 3) return "";
  return Format("%zu marks of %zu cameras leave no room for noticing a mistake; eight that two cameras see do", points.size(),
                kept.size());
}

/// Adds the covariances. A camera whose place stays uncertain by a quarter of the rig is named.
std::string AddCovariance(const MarkedClicks& clicked, const Solution& solution, geometry::Rig* rig) {
  std::vector<std::optional<Eigen::MatrixXd>> lenses;
  geometry::StatedCovariance stated;
  stated.begin = {0};
  for (const geometry::RigCamera& camera : clicked.rig.cameras) {
    lenses.push_back(camera.params_covariance);
    stated.lens_known.push_back(camera.params_covariance.has_value()), stated.pose_known.push_back(true);
    stated.begin.push_back(stated.begin.back() + camera.camera.params.size() + 6);
  }
  const PointBundleCovariance covariance = CovarianceOfPointBundle(solution.scene, solution.observations, solution.options,
                                                                   std::max(1.0, solution.bundle.sigma_px), lenses);
  if (covariance.status != Status::kOk) return "the marks do not determine all cameras: " + covariance.message;
  double size = 0;
  for (const geometry::RigCamera& a : rig->cameras)
    for (const geometry::RigCamera& b : rig->cameras) size = std::max(size, (a.CenterInWorld() - b.CenterInWorld()).norm());
  for (size_t c = 0; c < rig->cameras.size(); ++c) {
    const double sigma = std::sqrt(CentreCovariance(rig->cameras[c].cam_from_world, covariance.cam_from_world[c]).trace());
    if (sigma > 0.25 * size)
      return Format("the marks leave camera %s's place uncertain by %.0f %% of the rig's size: mark more, spread in depth",
                    rig->cameras[c].camera.name.c_str(), 100 * sigma / size);
  }
  stated.joint = covariance.joint, stated.correlated = true;
  geometry::StoreCovariance(stated, rig);
  return "";
}

void NameGross(const MarkedClicks& clicked, const ScenePoints& marks, const Solution& solution, MarkedRig* out) {
  const Eigen::Matrix2Xd residuals = PointResiduals(solution.scene, solution.observations);
  std::set<std::pair<int, int>> used;
  std::map<std::pair<int, int>, double> off;
  for (size_t i = 0; i < solution.observations.size(); ++i) {
    const PointObservation& o = solution.observations[i];
    const std::pair<int, int> key(o.camera_idx, solution.points[static_cast<size_t>(o.point_idx)]);
    if (o.weight > 0) used.insert(key);
    off[key] = residuals.col(static_cast<Eigen::Index>(i)).norm();
  }
  for (size_t c = 0; c < clicked.observations.size(); ++c) {
    out->num_clicks.push_back(static_cast<int>(clicked.observations[c].size())), out->num_used.push_back(0);
    for (const auto& [point, observation] : clicked.observations[c]) {
      const std::pair<int, int> key(static_cast<int>(c), point);
      out->num_used[c] += used.count(key) > 0;
      int views = 0;
      for (const auto& observations : clicked.observations) views += observations.count(point) > 0;
      if (used.count(key) || views < 2) continue;
      out->gross.push_back(marks.names[static_cast<size_t>(point)] + " in " + clicked.rig.cameras[c].camera.name +
                           (off.count(key) ? Format(": %.3g px", off.at(key)) : ": it fits no place"));
    }
  }
}

MarkedRig Failed(Status status, std::string message) {
  MarkedRig out;
  out.status = status, out.message = std::move(message);
  return out;
}

}  // namespace

MarkedRig PlaceFromMarks(const geometry::Rig& lenses, const ScenePoints& marks, double click_sigma_px) {
  constexpr size_t kMostStarts = 24;
  constexpr double kAlike = 9;  // of the cost: three standard deviations
  const MarkedClicks clicked = ClicksOf(lenses, marks, click_sigma_px);
  if (clicked.rig.cameras.size() < 2) return Failed(Status::kTooFewViews, "marks of one camera place nothing: two are needed");
  std::vector<RelativeStart> seeds = RelativeStarts(clicked);
  if (seeds.empty())
    return Failed(Status::kTooFewViews,
                  "no two cameras share six marks that fit one relative pose: mark more points that both see");
  if (seeds.size() > kMostStarts) seeds.resize(kMostStarts);
  std::vector<Solution> solutions;
  Solution failed;
  for (const RelativeStart& seed : seeds) {
    Solution solution = Complete(clicked, seed);
    if (solution.status == Status::kOk)
      solutions.push_back(std::move(solution));
    else if (failed.message.empty())
      failed = std::move(solution);
  }
  if (solutions.empty()) return Failed(failed.status, failed.message);
  const auto best =
      std::min_element(solutions.begin(), solutions.end(), [](const auto& x, const auto& y) { return x.cost < y.cost; });
  const std::string few = WhyTooFew(clicked, *best);
  if (!few.empty()) return Failed(Status::kTooFewViews, few);
  for (const Solution& other : solutions)
    if (other.cost < best->cost + kAlike && Differ(other, *best))
      return Failed(Status::kDegenerate,
                    "two arrangements of the cameras fit the marks alike, as marks in one plane do: mark some "
                    "off it, or more of them");
  MarkedRig out;
  out.rig = clicked.rig, out.rms_px = best->bundle.rms_px;
  for (size_t c = 0; c < out.rig.cameras.size(); ++c) out.rig.cameras[c].cam_from_world = best->scene.cam_from_world[c];
  const std::string loose = AddCovariance(clicked, *best, &out.rig);
  if (!loose.empty()) return Failed(Status::kDegenerate, loose);
  NameGross(clicked, marks, *best, &out);
  std::map<int, int> views;
  for (const PointObservation& o : best->observations) views[o.point_idx] += o.weight > 0;
  for (const auto& [point, count] : views)
    if (count >= 2)
      out.points[marks.names[static_cast<size_t>(best->points[static_cast<size_t>(point)])]] = best->scene.points.col(point);
  out.rig.gauge = geometry::RigGauge::OfCamera(out.rig.cameras[0].camera.name);
  return out;
}

}  // namespace mvstudio::calib
