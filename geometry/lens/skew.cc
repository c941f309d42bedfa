#include "geometry/lens/skew.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace mvstudio::geometry {

WithoutSkew ReplaceSkew(const Camera& camera, double skew_px) {
  Eigen::Matrix2d with_skew;
  with_skew << camera.fx(), skew_px, 0, camera.fy();
  // with_skew = diag(f) turn + rest; this angle makes the two entries of the rest that are off the diagonal alike.
  const double angle = std::atan2(-skew_px, camera.fx() + camera.fy());
  const Eigen::Matrix2d turn = Eigen::Rotation2Dd(angle).toRotationMatrix();
  WithoutSkew result;
  result.camera = camera;
  result.turn = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ());
  const Eigen::Matrix2d diagonal = (with_skew * turn.transpose()).diagonal().asDiagonal();
  result.camera.params[0] = diagonal(0, 0), result.camera.params[1] = diagonal(1, 1);
  Eigen::VectorXd& p = result.camera.params;
  if (HasOpenCvOrder(camera.model) && p.size() >= 8) {
    // (p2, p1) and the prism's (s1, s3), (s2, s4) turn as vectors; radial terms stay.
    const auto rotate = [&](Eigen::Index x, Eigen::Index y) {
      const Eigen::Vector2d rotated = turn * Eigen::Vector2d(p[x], p[y]);
      p[x] = rotated.x(), p[y] = rotated.y();
    };
    rotate(7, 6);
    if (p.size() >= 16) rotate(12, 14), rotate(13, 15);
  }
  const Eigen::Matrix2d lost = with_skew - diagonal * turn, inverse = with_skew.inverse();
  for (const double x : {0.0, camera.width_px - 1.0}) {
    for (const double y : {0.0, camera.height_px - 1.0}) {
      const Eigen::Vector2d behind_distortion = inverse * Eigen::Vector2d(x - camera.cx(), y - camera.cy());
      result.worst_px = std::max(result.worst_px, (lost * behind_distortion).norm());
    }
  }
  return result;
}

}  // namespace mvstudio::geometry
