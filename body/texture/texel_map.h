#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "body/body_template.h"

namespace mvstudio::body {

/// Where on the surface the centre of each texel lies.
struct TexelMap {
  int size_px = 0;
  std::vector<int> face;                     ///< (24, S, S) -1: no face has this place of the chart
  std::vector<Eigen::Vector3f> barycentric;  ///< (24, S, S) of the face's corners
};

TexelMap MapTexels(const BodyTemplate& body, int size_px);

}  // namespace mvstudio::body
