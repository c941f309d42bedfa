#include "calib/points/from_scene.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "calib/points/scene_adjustment.h"
#include "core/check.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

/// Point nearest to all rays; nothing when they are parallel.
std::optional<Eigen::Vector3d> NearestToRays(const std::vector<Eigen::Vector3d>& origins,
                                             const std::vector<Eigen::Vector3d>& directions) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < origins.size(); ++i) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - directions[i] * directions[i].transpose();
    a += across, b += across * (origins[i] - origins[0]);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(a);
  if (origins.size() < 2 || !(eigen.eigenvalues()[0] > 1e-4 * eigen.eigenvalues()[2])) return std::nullopt;
  return origins[0] + a.ldlt().solve(b);
}

struct Matched {
  Eigen::Matrix3Xd in_scene, in_world;
};

/// Known points that at least two cameras of the rig see, in the scene's frame.
Matched TriangulateKnown(const geometry::Rig& rig, const KnownPoints& known) {
  std::map<int, std::pair<std::vector<Eigen::Vector3d>, std::vector<Eigen::Vector3d>>> rays;
  for (const KnownPoints::Click& click : known.clicks) {
    const int c = rig.Find(click.camera);
    if (c < 0) continue;
    const geometry::RigCamera& camera = rig.cameras[static_cast<size_t>(c)];
    const geometry::Unprojection ray = geometry::Unproject(camera.camera, click.px);
    if (ray.status != Status::kOk) continue;
    auto& [origins, directions] = rays[click.point_idx];
    origins.push_back(camera.CenterInWorld());
    directions.push_back(camera.cam_from_world.rotation.conjugate() * ray.ray_in_cam);
  }
  std::vector<Eigen::Vector3d> in_scene, in_world;
  for (const auto& [point, r] : rays) {
    const auto x = NearestToRays(r.first, r.second);
    if (!x) continue;
    in_scene.push_back(*x);
    in_world.push_back(known.x_in_world.col(point));
  }
  Matched out;
  out.in_scene.resize(3, static_cast<Eigen::Index>(in_scene.size()));
  out.in_world.resize(3, static_cast<Eigen::Index>(in_scene.size()));
  for (size_t i = 0; i < in_scene.size(); ++i) {
    out.in_scene.col(static_cast<Eigen::Index>(i)) = in_scene[i];
    out.in_world.col(static_cast<Eigen::Index>(i)) = in_world[i];
  }
  return out;
}

Eigen::VectorXd Distances(const geometry::Alignment& a, const Matched& m) {
  const Eigen::Matrix3Xd moved =
      (a.b_from_a.rotation.toRotationMatrix() * (a.scale * m.in_scene)).colwise() + a.b_from_a.translation;
  return (moved - m.in_world).colwise().norm().transpose();
}

/// The alignment whose median distance is least among those of all triples (at most a few thousand), refitted to the points
/// near it.
geometry::Alignment AlignRobustly(const Matched& m) {
  const auto n = static_cast<int>(m.in_scene.cols());
  geometry::Alignment best = geometry::AlignPoints(m.in_scene, m.in_world, true);
  if (n < 5 || best.status != Status::kOk) return best;
  const auto median = [](Eigen::VectorXd d) { return UpperMedian(d.begin(), d.end()); };
  double least = median(Distances(best, m));
  const auto pick = [](const Eigen::Matrix3Xd& x, const std::vector<int>& ids) {
    Eigen::Matrix3Xd out(3, static_cast<Eigen::Index>(ids.size()));
    for (size_t i = 0; i < ids.size(); ++i) out.col(static_cast<Eigen::Index>(i)) = x.col(ids[i]);
    return out;
  };
  const int stride = std::max(1, n / 16);
  for (int a = 0; a < n; a += stride) {
    for (int b = a + 1; b < n; b += stride) {
      for (int c = b + 1; c < n; c += stride) {
        const geometry::Alignment trial = geometry::AlignPoints(pick(m.in_scene, {a, b, c}), pick(m.in_world, {a, b, c}), true);
        if (trial.status != Status::kOk) continue;
        const double value = median(Distances(trial, m));
        if (value < least) least = value, best = trial;
      }
    }
  }
  std::vector<int> near;
  const Eigen::VectorXd distances = Distances(best, m);
  for (int i = 0; i < n; ++i) {
    if (distances[i] <= 4 * least + 1e-12) near.push_back(i);
  }
  const geometry::Alignment refit = geometry::AlignPoints(pick(m.in_scene, near), pick(m.in_world, near), true);
  return refit.status == Status::kOk ? refit : best;
}

void Scale(const SceneSimilarity& s, geometry::Rig* rig, Eigen::Matrix3Xd* points) {
  const Rigid3 scene_from_world = geometry::Inverse(s.world_from_scene);
  for (geometry::RigCamera& camera : rig->cameras) {
    camera.cam_from_world.translation *= s.scale;
    camera.cam_from_world = camera.cam_from_world * scene_from_world;
  }
  *points = (s.world_from_scene.rotation.toRotationMatrix() * (s.scale * *points)).colwise() + s.world_from_scene.translation;
}

/// The frame of camera `a`, scaled so that `a` and `b` are apart as they are.
SceneSimilarity FromDistance(const geometry::Rig& rig, const SceneScale::Distance& distance) {
  SceneSimilarity out;
  const int a = rig.Find(distance.a), b = rig.Find(distance.b);
  if (a < 0 || b < 0) {
    out.status = Status::kTooFewViews;
    out.message = "camera " + (a < 0 ? distance.a : distance.b) + ", whose distance is known, could not be placed";
    return out;
  }
  const geometry::RigCamera &first = rig.cameras[static_cast<size_t>(a)], &second = rig.cameras[static_cast<size_t>(b)];
  const double length = (first.CenterInWorld() - second.CenterInWorld()).norm();
  if (!(length > 0)) {
    out.status = Status::kDegenerate, out.message = "cameras " + distance.a + " and " + distance.b + " stand in one place";
    return out;
  }
  out.scale = distance.distance_m / length;
  out.world_from_scene = first.cam_from_world;
  out.world_from_scene.translation *= out.scale;
  return out;
}

void AddKnown(const KnownPoints& known, const geometry::Rig& rig, SceneAdjustment* work) {
  const Eigen::Index n = work->scene.points.cols();
  work->scene.points.conservativeResize(3, n + known.x_in_world.cols());
  work->options.fix_point.assign(static_cast<size_t>(n), false);
  for (Eigen::Index i = 0; i < known.x_in_world.cols(); ++i) {
    const bool placed = known.x_in_world.col(i).allFinite();
    work->scene.points.col(n + i) = placed ? Eigen::Vector3d(known.x_in_world.col(i)) : Eigen::Vector3d::Zero();
    work->options.fix_point.push_back(true);
  }
  for (const KnownPoints::Click& click : known.clicks) {
    const int c = rig.Find(click.camera);
    if (c >= 0)
      work->observations.push_back({c, static_cast<int>(n) + click.point_idx, click.px, 1 / (known.sigma_px * known.sigma_px)});
  }
}

void AddScale(const SceneScale& scale, const geometry::Rig& rig, SceneAdjustment* work) {
  if (scale.points) return AddKnown(*scale.points, rig, work);
  const int a = rig.Find(scale.distance->a), b = rig.Find(scale.distance->b);
  work->options.fix_camera[static_cast<size_t>(a)] = true;
  work->options.distance = KnownDistance{a, b, scale.distance->distance_m, scale.distance->sigma_m};
}

double RmsLength(const Eigen::Matrix2Xd& residuals) {
  double sum = 0;
  int count = 0;
  for (Eigen::Index i = 0; i < residuals.cols(); ++i) {
    if (residuals.col(i).allFinite()) sum += residuals.col(i).squaredNorm(), ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

/// Adjusts the scene in its own unit; returns the standard deviation per coordinate of a feature.
double AdjustAlone(const std::vector<SceneImage>& images, const FromSceneOptions& options, bool own_lenses, int threads,
                   ColmapScene* scene, double* start_rms_px) {
  SceneAdjustment work = PrepareAdjustment(*scene, images, options, own_lenses, threads);
  *start_rms_px = RmsLength(PointResiduals(work.scene, work.observations));
  work.options.fix_camera[0] = true;
  const PointBundleReport report = SolvePointBundle(&work.scene, &work.observations, work.options);
  for (size_t c = 0; c < scene->rig.cameras.size(); ++c) {
    const std::string name = scene->rig.cameras[c].camera.name;
    scene->rig.cameras[c].camera = work.scene.LensOf(static_cast<int>(c));
    scene->rig.cameras[c].camera.name = name;
    scene->rig.cameras[c].cam_from_world = work.scene.cam_from_world[c];
  }
  scene->points = work.scene.points;
  constexpr double kFinestPx = 0.01;
  return std::max(report.sigma_px, kFinestPx);
}

using HeldLenses = std::vector<std::optional<Eigen::MatrixXd>>;

/// Covariances of the lenses that were given, per lens of the problem. Those of splined lenses, with their hundreds of numbers,
/// are not carried and so count as unknown.
HeldLenses HeldLensesOf(const SceneAdjustment& work, const ColmapScene& scene, const std::vector<SceneImage>& images) {
  HeldLenses held(work.scene.lenses.size());
  for (size_t c = 0; c < scene.rig.cameras.size(); ++c) {
    for (const SceneImage& image : images) {
      const bool fits = image.lens_covariance && image.lens_covariance->rows() == image.lens.params.size() &&
                        image.lens.params.size() <= kMaxLensDirections;
      if (image.camera == scene.rig.cameras[c].camera.name && image.lens_known && fits)
        held[static_cast<size_t>(work.scene.lens_of_camera[c])] = image.lens_covariance;
    }
  }
  return held;
}

void FillRig(const SceneAdjustment& work, const ColmapScene& scene, const PointBundleCovariance& covariance,
             const HeldLenses& held_lens, FromSceneReport* report) {
  for (size_t c = 0; c < scene.rig.cameras.size(); ++c) {
    geometry::RigCamera camera;
    camera.camera = work.scene.LensOf(static_cast<int>(c));
    camera.camera.name = scene.rig.cameras[c].camera.name;
    camera.cam_from_world = work.scene.cam_from_world[c];
    if (covariance.status == Status::kOk) {
      camera.cam_from_world_covariance = covariance.cam_from_world[c];
      const auto lens = static_cast<size_t>(work.scene.lens_of_camera[c]);
      const bool refined = work.options.lens_directions[lens].cols() > 0;
      if (refined || held_lens[lens]) camera.params_covariance = covariance.lens[lens];
    }
    report->rig.cameras.push_back(camera);
  }
  if (covariance.status == Status::kOk) report->rig.joint_covariance = covariance.joint;
  report->num_seen.assign(report->rig.cameras.size(), 0);
  std::set<int> points;
  for (size_t i = 0; i < work.first_click; ++i) {
    if (!(work.observations[i].weight > 0)) continue;
    ++report->num_seen[static_cast<size_t>(work.observations[i].camera_idx)];
    points.insert(work.observations[i].point_idx);
  }
  report->num_points = static_cast<int>(points.size());
}

void NameGross(const SceneAdjustment& work, const KnownPoints& known, const geometry::Rig& rig, FromSceneReport* report) {
  const Eigen::Matrix2Xd residuals = PointResiduals(work.scene, work.observations);
  for (size_t i = work.first_click; i < work.observations.size(); ++i) {
    const PointObservation& o = work.observations[i];
    if (o.weight > 0) continue;
    report->gross.push_back(known.names[static_cast<size_t>(o.point_idx - work.first_known)] + " in " +
                            rig.cameras[static_cast<size_t>(o.camera_idx)].camera.name + ": " +
                            Format("%.3g px", residuals.col(static_cast<Eigen::Index>(i)).norm()));
  }
}

/// colmap's order is that of its images' sizes and lenses.
void SortByImages(const std::vector<SceneImage>& images, FromSceneReport* report) {
  geometry::Rig sorted;
  std::vector<int> num_seen;
  for (const SceneImage& image : images) {
    const int c = report->rig.Find(image.camera);
    if (c < 0) {
      report->missing.push_back(image.camera);
      continue;
    }
    sorted.cameras.push_back(report->rig.cameras[static_cast<size_t>(c)]);
    num_seen.push_back(report->num_seen[static_cast<size_t>(c)]);
  }
  std::vector<int> order;
  for (const geometry::RigCamera& camera : report->rig.cameras) order.push_back(sorted.Find(camera.camera.name));
  report->rig.joint_covariance = geometry::ReorderedJointCovariance(report->rig, order);
  report->rig.cameras = sorted.cameras;
  report->num_seen = num_seen;
}

FromSceneReport Refused(Status status, const std::string& message) {
  FromSceneReport report;
  report.status = status, report.message = message;
  return report;
}

}  // namespace

KnownPoints KnownFromScenePoints(const ScenePoints& points, double click_sigma_px) {
  KnownPoints known;
  known.names = points.names;
  known.x_in_world = points.x_in_world;
  known.sigma_px = click_sigma_px;
  known.gauge.kind = geometry::RigGauge::Kind::kPoints;
  for (const PointClick& click : points.clicks)
    known.clicks.push_back({points.cameras[static_cast<size_t>(click.camera_idx)], click.point_idx, click.px});
  return known;
}

KnownPoints KnownFromBoard(const Board& board, const std::vector<Detection>& detections,
                           const std::vector<std::string>& camera_names) {
  std::map<int64_t, std::set<int>> seen;
  for (const Detection& detection : detections) seen[detection.frame_idx].insert(detection.camera_idx);
  KnownPoints known;
  if (seen.empty()) return known;
  const auto best = std::max_element(seen.begin(), seen.end(),
                                     [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  known.x_in_world = CornersInBoard(board);
  known.sigma_px = 0.3;
  known.gauge.kind = geometry::RigGauge::Kind::kSceneBoard, known.gauge.frame = best->first;
  for (int i = 0; i < known.x_in_world.cols(); ++i) known.names.push_back("corner " + std::to_string(i));
  for (const Detection& detection : detections) {
    if (detection.frame_idx != best->first) continue;
    for (int i = 0; i < detection.num_corners(); ++i)
      known.clicks.push_back({camera_names[static_cast<size_t>(detection.camera_idx)],
                              detection.corner_ids[static_cast<size_t>(i)], detection.points_px.col(i)});
  }
  return known;
}

SceneScale::Distance ParseCameraDistance(const std::string& text) {
  const auto fail = [&] {
    return UsageError("option 'camera-distance' '" + text + "': expected CAMERA:CAMERA:LENGTH, e.g. left:right:1.234m");
  };
  const size_t last = text.rfind(':'), first = text.find(':');
  if (last == std::string::npos || first == last) throw fail();
  SceneScale::Distance distance{text.substr(0, first), text.substr(first + 1, last - first - 1), 0, 0};
  size_t used = 0;
  try {
    distance.distance_m = std::stod(text.substr(last + 1), &used);
  } catch (const std::exception&) {
    throw fail();
  }
  const std::string unit = text.substr(last + 1 + used);
  if (unit != "m" && unit != "cm" && unit != "mm") throw fail();
  distance.distance_m *= unit == "mm" ? 1e-3 : unit == "cm" ? 1e-2 : 1;
  if (!(distance.distance_m > 0) || !std::isfinite(distance.distance_m) || distance.a == distance.b || distance.a.empty())
    throw fail();
  return distance;
}

SceneSimilarity AlignScene(const geometry::Rig& rig, const KnownPoints& known) {
  SceneSimilarity out;
  const Matched matched = TriangulateKnown(rig, known);
  out.num_points = static_cast<int>(matched.in_scene.cols());
  if (out.num_points < 3) {
    out.status = Status::kTooFewViews;
    out.message = std::to_string(out.num_points) + " known points are seen by two placed cameras; at least 3 are needed";
    return out;
  }
  const geometry::Alignment alignment = AlignRobustly(matched);
  out.status = alignment.status;
  if (out.status != Status::kOk) out.message = "the known points do not fix place and scale: they lie on one line";
  out.scale = alignment.scale, out.world_from_scene = alignment.b_from_a, out.rms_m = alignment.rms;
  return out;
}

FromSceneReport AdjustScene(const ColmapScene& input, const std::vector<SceneImage>& images, const SceneScale& scale,
                            const FromSceneOptions& options, const RunContext& run) {
  if (!scale.points && !scale.distance) {
    throw UsageError(
        "the scale of a scene is not seen in images: give a board, option 'scene-points' or option 'camera-distance'");
  }
  if (input.rig.cameras.size() < 2 || input.tracks.empty())
    return Refused(Status::kTooFewViews,
                   "no two images fit together: the scene needs more texture, or cameras that see more of the same surfaces");
  const int threads = ResolveThreads(run.num_threads);
  ColmapScene scene = input;
  FromSceneReport report;
  report.feature_sigma_px = AdjustAlone(images, options, false, threads, &scene, &report.colmap_rms_px);
  const auto unknown = std::count_if(images.begin(), images.end(), [](const SceneImage& i) { return !i.lens_known; });
  if (unknown > 1 && options.refine_intrinsics && OwnLensesPay(scene, images, options, report.feature_sigma_px, threads)) {
    report.own_lenses = true;
    double again = 0;
    report.feature_sigma_px = AdjustAlone(images, options, true, threads, &scene, &again);
  }
  const SceneSimilarity similarity =
      scale.points ? AlignScene(scene.rig, *scale.points) : FromDistance(scene.rig, *scale.distance);
  if (similarity.status != Status::kOk) return Refused(similarity.status, similarity.message);
  Scale(similarity, &scene.rig, &scene.points);
  SceneAdjustment work = PrepareAdjustment(scene, images, options, report.own_lenses, threads);
  for (PointObservation& o : work.observations) o.weight = 1 / (report.feature_sigma_px * report.feature_sigma_px);
  work.options.min_sigma = 1;
  AddScale(scale, scene.rig, &work);
  report.rig.gauge = scale.points ? scale.points->gauge : geometry::RigGauge::OfCamera(scale.distance->a);
  if (!scale.points) report.rig.gauge.distance_to = scale.distance->b;
  report.bundle = SolvePointBundle(&work.scene, &work.observations, work.options);
  report.status = report.bundle.status, report.message = report.bundle.message;
  const double sigma = std::max(1.0, report.bundle.sigma_px);
  report.clusters = InflationByClusters(work.scene, work.observations, work.options, sigma);
  const HeldLenses held_lens = HeldLensesOf(work, scene, images);
  const PointBundleCovariance covariance = CovarianceOfPointBundle(work.scene, work.observations, work.options,
                                                                   sigma * std::sqrt(report.clusters.factor), held_lens);
  if (report.status == Status::kOk && covariance.status != Status::kOk)
    report.status = covariance.status, report.message = covariance.message;
  FillRig(work, scene, covariance, held_lens, &report);
  if (scale.points) NameGross(work, *scale.points, scene.rig, &report);
  SortByImages(images, &report);
  return report;
}

}  // namespace mvstudio::calib
