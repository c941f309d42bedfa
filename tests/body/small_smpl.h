#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/disk/npy.h"
#include "core/random.h"

/// A small body in SMPL's layout.
namespace mvstudio::body::small_smpl {

inline constexpr int kBones = 24, kShapes = 3;
inline constexpr int kParents[kBones] = {-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21};

using Arrays = std::map<std::string, NpyArray>;

/// Joints in SMPL's frame: y up, the person faces z, arms spread.
inline Eigen::Matrix3Xd Joints() {
  Eigen::Matrix3Xd x(3, kBones);
  x << 0, 0.07, -0.07, 0, 0.1, -0.1, 0, 0.09, -0.09, 0, 0.1, -0.1, 0, 0.08, -0.08, 0, 0.18, -0.18, 0.44, -0.44, 0.7, -0.7, 0.78,
      -0.78,  //
      0, -0.09, -0.09, 0.11, -0.48, -0.48, 0.25, -0.88, -0.88, 0.3, -0.94, -0.94, 0.51, 0.42, 0.42, 0.58, 0.45, 0.45, 0.44,
      0.44, 0.44, 0.44, 0.43, 0.43,  //
      0, 0, 0, -0.02, 0, 0, 0, -0.04, -0.04, 0.02, 0.1, 0.1, -0.02, 0, 0, 0.02, -0.01, -0.01, -0.03, -0.03, -0.03, -0.03, -0.03,
      -0.03;
  return x;
}

inline NpyArray Filled(std::vector<int64_t> shape, double scale, Rng* rng) {
  int64_t count = 1;
  for (const int64_t size : shape) count *= size;
  NpyArray array{std::move(shape), std::vector<double>(static_cast<size_t>(count))};
  for (double& value : array.values) value = scale * rng->Normal();
  return array;
}

/// A closed octahedron about each joint, moved by its bone and a little by another; each joint is the mean of its octahedron.
inline Arrays Model() {
  static constexpr int kFaces[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  const int64_t num_vertices = 6 * kBones;
  const Eigen::Matrix3Xd joints = Joints();
  Rng rng(4);
  Arrays arrays;
  NpyArray x{{num_vertices, 3}, {}}, faces{{8 * kBones, 3}, {}}, table{{2, kBones}, {}};
  NpyArray weights{{num_vertices, kBones}, std::vector<double>(static_cast<size_t>(num_vertices * kBones))};
  NpyArray regressor{{kBones, num_vertices}, std::vector<double>(static_cast<size_t>(num_vertices * kBones))};
  for (int b = 0; b < kBones; ++b) {
    for (int i = 0; i < 6; ++i) {
      Eigen::Vector3d corner = joints.col(b);
      corner[i / 2] += i % 2 == 0 ? 0.06 : -0.06;
      x.values.insert(x.values.end(), corner.data(), corner.data() + 3);
      const int v = 6 * b + i;
      weights.values[static_cast<size_t>(v * kBones + b)] += 0.8;
      weights.values[static_cast<size_t>(v * kBones + std::max(0, kParents[b]))] += 0.2;
      regressor.values[static_cast<size_t>(b * num_vertices + v)] = 1.0 / 6;
    }
    for (const auto& face : kFaces) {
      for (const int corner : face) faces.values.push_back(6 * b + corner);
    }
    table.values.push_back(b == 0 ? 4294967295.0 : kParents[b]);
  }
  for (int b = 0; b < kBones; ++b) table.values.push_back(b);
  return {{"v_template", x},
          {"f", faces},
          {"kintree_table", table},
          {"weights", weights},
          {"J_regressor", regressor},
          {"shapedirs", Filled({num_vertices, 3, kShapes}, 0.005, &rng)},
          {"posedirs", Filled({num_vertices, 3, 9 * (kBones - 1)}, 0.002, &rng)}};
}

}  // namespace mvstudio::body::small_smpl
