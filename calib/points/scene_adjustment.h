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

/// Colmap's model as a problem: every feature has weight 1, nothing is fixed. Unknown lenses are shared by the cameras of
/// one image size, or with `own_lenses` each camera has one.
SceneAdjustment PrepareAdjustment(const ColmapScene& scene, const std::vector<SceneImage>& images,
                                  const FromSceneOptions& options, bool own_lenses, int num_threads);

/// True when unknown lenses are better not shared. Cameras and lenses are adjusted to every second cube of the scene, with
/// shared and with own lenses, and tested on the points of the other cubes. Then the cubes are exchanged.
///
/// Own lenses are taken when the sum of squared residuals (capped at the rejection limit) falls by three standard errors
/// of the difference, and by a tenth in either half. The tenth is needed because feature errors depend on the viewing
/// direction, which own lenses mimic to some hundredths; focal lengths that differ by 1 % gain nine tenths. The unit is
/// the cube, not the point, because errors of neighbouring features are correlated (see ClusterInflation). `scene` is the
/// solution with shared lenses.
bool OwnLensesPay(const ColmapScene& scene, const std::vector<SceneImage>& images, const FromSceneOptions& options,
                  double feature_sigma_px, int num_threads);

}  // namespace mvstudio::calib
