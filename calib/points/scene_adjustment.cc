#include "calib/points/scene_adjustment.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "calib/points/point_clusters.h"
#include "core/check.h"
#include "core/choice/heldout_choice.h"

namespace mvstudio::calib {
namespace {

Eigen::MatrixXd LensDirections(const SceneImage& image, const geometry::Camera& lens, bool refine) {
  if (image.lens_known || !refine) return FixedLens(lens);
  const geometry::LensTraits& traits = geometry::TraitsOf(lens.model);
  int radial = 0;
  while (radial < std::min(traits.num_params, 2) && traits.params[radial].role == geometry::LensRole::kNumerator) ++radial;
  return FocalDirections(lens, radial);
}

const SceneImage& ImageOf(const std::vector<SceneImage>& images, const std::string& camera) {
  const auto found = std::find_if(images.begin(), images.end(), [&](const SceneImage& i) { return i.camera == camera; });
  MVS_CHECK(found != images.end(), "no image of camera " << camera);
  return *found;
}

/// Squared residuals of the points that took no part, per point: cameras stay, the points are adjusted; cut off at `limit`.
std::map<int, double> HeldOutCosts(const SceneAdjustment& solved, const std::vector<PointObservation>& held_out, double limit) {
  PointScene scene = solved.scene;
  std::vector<PointObservation> observations = held_out;
  PointBundleOptions options = solved.options;
  for (size_t l = 0; l < scene.lenses.size(); ++l) options.lens_directions[l] = FixedLens(scene.lenses[l]);
  options.fix_camera.assign(scene.cam_from_world.size(), true);
  SolvePointBundle(&scene, &observations, options);
  const Eigen::Matrix2Xd residuals = PointResiduals(scene, observations);
  std::map<int, double> costs;
  for (size_t i = 0; i < observations.size(); ++i) {
    const double squared = residuals.col(static_cast<Eigen::Index>(i)).squaredNorm();
    costs[observations[i].point_idx] += std::min(squared, limit * limit);  // infinite ones are cut off, too
  }
  return costs;
}

int FoldOf(const Cube& cube) { return static_cast<int>((cube[0] + cube[1] + cube[2]) & 1); }

/// Three standard errors: with two, one scene of a hundred whose cameras share a lens would be given eight.
bool IsAboveNoise(const std::map<Cube, double>& gains) {
  std::vector<double> units;
  for (const auto& [cube, gain] : gains) units.push_back(gain);
  const UnitMean gain = MeanOverUnits(units);
  return gain.num_units > 1 && InStandardErrors(gain) > 3;
}

}  // namespace

SceneAdjustment PrepareAdjustment(const ColmapScene& scene, const std::vector<SceneImage>& images,
                                  const FromSceneOptions& options, bool own_lenses, int num_threads) {
  SceneAdjustment work;
  std::map<std::pair<int, int>, int> shared;  // lens of the cameras of one image size whose lenses are not known
  for (const geometry::RigCamera& camera : scene.rig.cameras) {
    const SceneImage& image = ImageOf(images, camera.camera.name);
    work.scene.cam_from_world.push_back(camera.cam_from_world);
    const std::pair<int, int> size(camera.camera.width_px, camera.camera.height_px);
    const auto next = static_cast<int>(work.scene.lenses.size());
    work.scene.lens_of_camera.push_back(image.lens_known || own_lenses ? next : shared.insert({size, next}).first->second);
    if (work.scene.lens_of_camera.back() != next) continue;
    work.scene.lenses.push_back(image.lens_known ? image.lens : camera.camera);
    work.options.lens_directions.push_back(LensDirections(image, work.scene.lenses.back(), options.refine_intrinsics));
  }
  work.scene.points = scene.points;
  for (const ColmapTrackPoint& t : scene.tracks) work.observations.push_back({t.image_idx, t.point_idx, t.px, 1});
  work.first_known = static_cast<int>(scene.points.cols());
  work.first_click = work.observations.size();
  work.options.fix_camera.assign(scene.rig.cameras.size(), false);
  work.options.reject_sigmas = options.reject_sigmas;
  work.options.num_threads = num_threads;
  return work;
}

bool OwnLensesPay(const ColmapScene& scene, const std::vector<SceneImage>& images, const FromSceneOptions& options,
                  double feature_sigma_px, int num_threads) {
  const SceneAdjustment start = PrepareAdjustment(scene, images, options, false, num_threads);
  constexpr double kCubesPerSide = 8, kWorthwhile = 0.1;
  const double cell = SceneSide(start.scene, start.observations, start.options) / kCubesPerSide;
  if (!(cell > 0) || !std::isfinite(cell)) return false;
  std::map<Cube, double> gains;
  for (const int fold : {0, 1}) {
    std::map<int, double> costs[2];
    for (const bool own : {false, true}) {
      SceneAdjustment work = PrepareAdjustment(scene, images, options, own, num_threads);
      std::vector<PointObservation> fitted, held_out;
      for (const PointObservation& o : work.observations)
        (FoldOf(CubeOf(scene.points.col(o.point_idx), cell)) == fold ? held_out : fitted).push_back(o);
      work.options.fix_camera[0] = true;
      if (SolvePointBundle(&work.scene, &fitted, work.options).status != Status::kOk) return false;
      costs[own] = HeldOutCosts(work, held_out, options.reject_sigmas * feature_sigma_px);
    }
    double before = 0, after = 0;
    for (const auto& [point, shared] : costs[0]) {
      before += shared, after += costs[1][point];
      gains[CubeOf(scene.points.col(point), cell)] += shared - costs[1][point];
    }
    if (!(after < (1 - kWorthwhile) * before)) return false;
  }
  return IsAboveNoise(gains);
}

}  // namespace mvstudio::calib
