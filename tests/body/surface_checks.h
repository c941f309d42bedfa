#pragma once

#include <gtest/gtest.h>

#include <map>
#include <utility>

#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// Every edge belongs to two faces that run along it in opposite directions, and the surface encloses a positive volume.
inline void ExpectClosedSurface(const BodyTemplate& body) {
  std::map<std::pair<int, int>, int> edges;
  double volume = 0;
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) ++edges[{body.faces(k, f), body.faces((k + 1) % 3, f)}];
    Eigen::Matrix3d x;
    for (int k = 0; k < 3; ++k) x.col(k) = body.vertices.col(body.faces(k, f)).cast<double>();
    volume += x.determinant() / 6;
  }
  int bad = 0;
  for (const auto& [edge, count] : edges) bad += count != 1 || edges.count({edge.second, edge.first}) != 1;
  EXPECT_EQ(bad, 0) << "of " << edges.size() << " edges";
  EXPECT_GT(volume, 0);
}

inline void ExpectSoundSkin(const BodyTemplate& body) {
  for (Eigen::Index i = 0; i < body.vertices.cols(); ++i) {
    ASSERT_NEAR(body.skin_weights.col(i).sum(), 1, 1e-5) << "vertex " << i;
    ASSERT_GE(body.skin_weights.col(i).minCoeff(), 0) << "vertex " << i;
    ASSERT_GE(body.skin_bones.col(i).minCoeff(), 0) << "vertex " << i;
    ASSERT_LT(body.skin_bones.col(i).maxCoeff(), static_cast<int>(body.bone_names.size())) << "vertex " << i;
  }
  for (size_t b = 0; b < body.bone_parents.size(); ++b) ASSERT_LT(body.bone_parents[b], static_cast<int>(b));
}

}  // namespace mvstudio::body
