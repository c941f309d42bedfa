#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "avatar/body/body_template.h"
#include "core/image.h"

namespace mvstudio::body {

/// Where on the surface the centre of each texel lies.
struct TexelMap {
  int size_px = 0;
  std::vector<int> face;                     ///< (24, S, S) -1: no face has this place of the chart
  std::vector<Eigen::Vector3f> barycentric;  ///< (24, S, S) of the face's corners
};

TexelMap MapTexels(const BodyTemplate& body, int size_px);

/// `values` (3, V) of the vertices between the corners of the face that a texel shows; the texel shows one.
Eigen::Vector3f AtTexel(const BodyTemplate& body, const TexelMap& map, size_t texel, const Eigen::Matrix3Xf& values);

/// Texels that are not `known` (24, S, S) take the mean of their known neighbours, from the seams inwards. Those farther than
/// an eighth of the chart from any known one take the colour of their row (MeanChartRows), as long as any is known.
void FillTexels(std::vector<uint8_t> known, std::array<Image, kNumParts>* textures);

}  // namespace mvstudio::body
