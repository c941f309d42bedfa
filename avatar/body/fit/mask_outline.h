#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/image.h"

namespace mvstudio::body {

/// The outline of a mask between its pixels: where the bilinear interpolation of its values crosses one half.
class MaskOutline {
 public:
  /// `mask` (H, W, 1): 0 background, 255 person; values between them are shares of a pixel.
  explicit MaskOutline(Image mask);

  /// Signed distance (px) from `px` to the outline along the unit vector `outward`, positive where the outline lies further
  /// out. Empty when there is none within `max_px`, when it lies outside the image, or when it runs across `outward` by more
  /// than 60 degrees: then it belongs to another limb.
  std::optional<double> Distance(const Eigen::Vector2d& px, const Eigen::Vector2d& outward, double max_px) const;

  /// Bilinear value in [0, 1]; NaN outside the image.
  double At(const Eigen::Vector2d& px) const;
  const Image& mask() const { return mask_; }

 private:
  /// Where along `outward` the outline is crossed, between a place inside and one outside.
  double Crossing(const Eigen::Vector2d& px, const Eigen::Vector2d& outward, double inner, double outer) const;
  bool Faces(const Eigen::Vector2d& px, const Eigen::Vector2d& outward) const;

  Image mask_;
};

}  // namespace mvstudio::body
