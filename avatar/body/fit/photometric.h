#pragma once

#include <Eigen/Core>
#include <vector>

#include "avatar/body/body_template.h"
#include "core/image.h"
#include "geometry/rig/rig.h"

/// Brightness of the surface: how a body's pose is aligned with images beyond its outline.
namespace mvstudio::body {

/// Brightness smoothed over the person alone, in [0, 1]. Outside the mask: undefined.
class SmoothBrightness {
 public:
  /// `grey` and `mask` (H, W, 1); Gaussian of `sigma_px`, normalised by the smoothed mask.
  SmoothBrightness(const Image& grey, const Image& mask, double sigma_px);

  /// Value and derivative (1 / px) by bilinear interpolation; false near the image's edge and where less than half of the
  /// Gaussian's weight lies on the person.
  bool At(const Eigen::Vector2d& px, double* value, Eigen::RowVector2d* gradient) const;

 private:
  int width_, height_;
  std::vector<float> value_, cover_;  // (H, W)
};

/// A vertex in an image.
struct SeenVertex {
  int vertex = 0;
  double value = 0;                                             ///< smoothed brightness at the vertex
  Eigen::RowVector3d d_value_d_x = Eigen::RowVector3d::Zero();  ///< per metre of the vertex in world
  double weight = 0;                                            ///< cosine of the angle of sight
};

/// Vertices that no other part of the body hides and that are seen at less than 70 degrees.
std::vector<SeenVertex> SeeVertices(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                                    const geometry::RigCamera& camera, const SmoothBrightness& brightness);

/// What a body's vertices look like in the mean over many images.
struct MeanBrightness {
  Eigen::VectorXd value, weight;  ///< (V) in [0, 1]; sum of the weights of what was seen
  double sigma = 0;               ///< of one image against the mean
};

/// The mean, weighted by the squares of the weights; its `sigma` is robust, at least a grey level.
MeanBrightness MeanOf(Eigen::Index num_vertices, const std::vector<std::vector<std::vector<SeenVertex>>>& seen);

}  // namespace mvstudio::body
