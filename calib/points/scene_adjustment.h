#pragma once

#include "calib/points/from_scene.h"

/// Steps of AdjustScene.
namespace mvstudio::calib {

struct SceneAdjustment {
  PointScene scene;
  std::vector<PointObservation> observations;
  PointBundleOptions options;
  int first_known = 0;     ///< points from here on are known
  size_t first_click = 0;  ///< observations from here on are of known points
};

/// The model of colmap as a problem: every feature has weight 1, nothing is held in place. Lenses that are not known are shared
/// by the cameras of one image size, or with `own_lenses` each camera has one.
SceneAdjustment PrepareAdjustment(const ColmapScene& scene, const std::vector<SceneImage>& images,
                                  const FromSceneOptions& options, bool own_lenses, int num_threads);

/// True when lenses that are not known are better not shared: cameras and lenses are adjusted to every second cube of the
/// scene, with shared and with own lenses, and judged on the points of the other cubes, then the other way round. Own lenses
/// are taken when the sum of squared residuals (cut off at the rejection limit) is lower by three standard errors of the
/// difference, and by a tenth in either half: features err with the direction they are seen from, which lenses of one's own
/// mimic to some hundredths; focal lengths that differ by 1 % gain nine tenths. Cubes, not points, are the unit: neighbouring
/// features do not err independently (see ClusterInflation). `scene` is the solution with shared lenses.
bool OwnLensesPay(const ColmapScene& scene, const std::vector<SceneImage>& images, const FromSceneOptions& options,
                  double feature_sigma_px, int num_threads);

}  // namespace mvstudio::calib
