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

/// ASCII PLY with `double` coordinates, so that no digit is lost; `edges` are pairs of indices, left out when empty.
std::string PlyText(const std::vector<ColouredPoint>& points, const std::vector<std::pair<int, int>>& edges,
                    const std::string& comment);

/// Binary little-endian PLY with `float` coordinates, normals (0) and colours: what Gaussian splatting and nerfstudio load.
std::string PlyBinary(const std::vector<ColouredPoint>& points);

}  // namespace mvstudio::exports
