#pragma once

#include "calib/from_scene.h"

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

/// True when lenses that are not known are better not shared: cameras and lenses are adjusted to every second point, with
/// shared and with own lenses, and judged on the other points. Own lenses are taken when the mean squared residual (cut off at
/// the rejection limit) is lower by two standard errors of the difference. `scene` is the solution with shared lenses.
bool OwnLensesPay(const ColmapScene& scene, const std::vector<SceneImage>& images, const FromSceneOptions& options,
                  double feature_sigma_px, int num_threads);

}  // namespace mvstudio::calib
