#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "geometry/rigid/rigid3.h"

/// A fitted body over time, as `avatar fit` and `avatar train` leave it.
namespace mvstudio::stages {

struct MovingBody {
  Eigen::Matrix3Xd rest;                                ///< (3, V) metres, in body
  Eigen::Matrix3Xi faces;                               ///< (3, F) vertices
  Eigen::Matrix4Xi bones;                               ///< (4, V) that move a vertex
  Eigen::Matrix4Xd weights;                             ///< (4, V), columns sum to 1
  std::vector<int> frames;                              ///< ascending
  std::vector<std::vector<geometry::Rigid3>> at_frame;  ///< of each frame, of each bone: world_from_body
};

/// body_motion.bin of docs/formats.md. Throws IoError, FormatError.
MovingBody ReadMovingBody(const std::string& path);

/// Vertices in world, (3, V) metres, by linear blend skinning. Between two frames that are thinned evenly the nearer one
/// counts; nothing before the first, behind the last, and in gaps of more than twice the usual distance.
std::optional<Eigen::Matrix3Xd> BodyAt(const MovingBody& body, int frame);

}  // namespace mvstudio::stages
