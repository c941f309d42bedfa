#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace mvstudio::exports {

struct ColouredPoint {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();  ///< metres
  std::array<uint8_t, 3> rgb{};
};

/// ASCII PLY with `double` coordinates, without loss of digits; `edges` are pairs of indices, omitted when empty. Each of
/// `comments` is a line.
std::string PlyText(const std::vector<ColouredPoint>& points, const std::vector<std::pair<int, int>>& edges,
                    const std::vector<std::string>& comments);

/// Binary little-endian PLY with `float` coordinates, normals (0) and colours, as loaded by Gaussian splatting and
/// nerfstudio.
std::string PlyBinary(const std::vector<ColouredPoint>& points);

}  // namespace mvstudio::exports
