#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace mvstudio::body {

/// Directions in which a template may vary: displacements in body, metres for a coefficient of one. A column is a (3, N) matrix
/// column by column: x, y, z of the first point, then of the second.
struct BlendShapes {
  Eigen::MatrixXf vertices;        // (3V, S)
  Eigen::MatrixXd heads, tails;    // (3B, S) of the bones
  Eigen::MatrixXd coco19;          // (57, S) of the Panoptic joints
  std::vector<std::string> names;  // (S)
  Eigen::VectorXd low, high;       // (S) coefficients between which the body looks like one; not enforced
  Eigen::VectorXd sigma;           // (S) standard deviation for a prior on the coefficients, about zero
};

}  // namespace mvstudio::body
