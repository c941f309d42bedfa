#pragma once

#include "avatar/body/body_template.h"
#include "avatar/body/texture/bake.h"
#include "avatar/splats/raster.h"

namespace mvstudio::splats {

struct Rendered {
  RasterImage<float> image;
  SkippedSplats skipped;
  int64_t shown = 0;  ///< Gaussians that touch the image
};

/// The cloud on a body's faces (3, F) with posed vertices (3, V), metres in world, on black. Throws ContractViolation for
/// arrays that do not match and for a camera that is no pinhole.
Rendered RenderSplats(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices_in_world,
                      const geometry::RigCamera& camera, const RenderSettings& settings);

/// The same in 8 bits, as RenderBody gives the body: colours premultiplied, and coverage.
body::RenderedBody RenderGaussians(const Cloud& cloud, const body::BodyTemplate& body,
                                   const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera,
                                   const RenderSettings& settings);

}  // namespace mvstudio::splats
