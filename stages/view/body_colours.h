#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/image.h"
#include "geometry/rig/rig.h"

/// The colours of a fitted body, as `avatar fit` and `avatar train` leave them beside its motion.
namespace mvstudio::stages {

struct BodyColours {
  std::vector<int> vertices;  ///< (C) of the body: its corners, cut where the image has seams
  Eigen::Matrix2Xd uv;        ///< (2, C) in the image, 0 to 1, v down
  Eigen::Matrix3Xi faces;     ///< (3, F) corners
  Image atlas;                ///< RGB
};

/// body_texture.bin of docs/formats.md for a body of `num_vertices`. Throws IoError, FormatError.
BodyColours ReadBodyColours(const std::string& path, int64_t num_vertices);

/// What the camera sees of the body, (H, W, 4) with opacity 0 around it: H and W are the lens's, reduced to a longer side of at
/// most `longer_side_px`. `vertices`: (3, V) metres in world; without any the image is empty.
Image BodyInColours(const BodyColours& colours, const Eigen::Matrix3Xd& vertices, const geometry::RigCamera& camera,
                    int longer_side_px);

}  // namespace mvstudio::stages
