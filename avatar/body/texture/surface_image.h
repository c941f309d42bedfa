#pragma once

#include <Eigen/Core>

#include "avatar/body/body_template.h"
#include "avatar/body/texture/bake.h"
#include "core/image.h"

/// Numbers of a body's vertices as colours.
namespace mvstudio::body {

/// Charts of `size_px` from colours of the vertices, (3, V) in [0, 1].
Textures PaintVertices(const BodyTemplate& body, const Eigen::Matrix3Xf& colours, int size_px);

/// Blue at -limit, light grey at 0, red at limit; dark grey for what is not finite. (3) in [0, 1].
Eigen::Vector3f DivergingColour(double value, double limit);

/// Values that an image's scale shows from its left to its right end; colours are those of DivergingColour with this limit.
struct ColourRange {
  double low = -1, limit = 1;
};

/// `values` (V) on the body at rest, from the front and from the back on white, (height_px, about height_px, 3), shaded; below
/// them the scale.
Image SurfaceImage(const BodyTemplate& body, const Eigen::VectorXd& values, const ColourRange& range, int height_px);

}  // namespace mvstudio::body
