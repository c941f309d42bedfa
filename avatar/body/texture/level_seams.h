#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <vector>

#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// Corrections of the colours at the corners of the faces, red, green, blue in grey levels.
struct SeamCorrections {
  std::vector<std::array<int, 3>> node_of_corner;  ///< (F) columns of `levels`; -1: the face has no view
  Eigen::MatrixXf levels;                          ///< (3, N) one for each vertex and view that meet in a face

  Eigen::Vector3f At(int face, const Eigen::Vector3f& barycentric) const;
};

/// Makes views agree where their faces meet: minimises, at the vertices there, the squared differences of the corrected colours
/// and, over the edges inside each view's faces, 10 times those of neighbouring corrections (Lempitsky, Ivanov, 2007).
/// `colour(vertex, view)` in grey levels; not finite where the view does not show the vertex, which is then left out.
SeamCorrections LevelSeams(const BodyTemplate& body, const std::vector<int>& view_of_face,
                           const std::function<Eigen::Vector3f(int vertex, int view)>& colour);

}  // namespace mvstudio::body
