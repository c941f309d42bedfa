#pragma once

#include <cstdint>

#include "avatar/body/body_template.h"
#include "avatar/body/texture/bake.h"
#include "avatar/splats/cloud.h"

namespace mvstudio::splats {

/// `count` Gaussians spread evenly over a body's surface at rest, seeded: flat on their triangles and a little below them, as
/// wide as the surface that each covers, nearly opaque, in the colour of the texel below. So their image is about that of the
/// textured body. Triangles without area carry none. Throws ContractViolation for a body without area, or a degree beyond
/// kMaxDegree.
Cloud CoverBody(const body::BodyTemplate& body, const body::Textures& textures, int64_t count, int degree, uint64_t seed);

/// Area of a body's surface at rest, m^2.
double SurfaceArea(const body::BodyTemplate& body);

}  // namespace mvstudio::splats
