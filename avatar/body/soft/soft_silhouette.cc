#include "avatar/body/soft/soft_silhouette.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "avatar/body/soft/mesh_outline.h"
#include "core/check.h"
#include "geometry/lens/camera.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector2d;

/// Nearest points of the outline, pixel by pixel.
class NearestPoints {
 public:
  NearestPoints(const Eigen::Matrix2Xd& px, int width_px, int height_px, double reach_px)
      : px_(px),
        width_(width_px),
        height_(height_px),
        reach_(reach_px),
        squares_(static_cast<size_t>(width_px) * height_px, reach_px * reach_px),
        nearest_(squares_.size()) {}

  void Add(const OutlinePiece& piece) {
    const Vector2d a = px_.col(piece.a), step = px_.col(piece.b) - px_.col(piece.a);
    const Vector2d first = a + piece.first * step, last = a + piece.last * step;
    const Vector2d low = first.cwiseMin(last).array() - reach_, high = first.cwiseMax(last).array() + reach_;
    const int x0 = static_cast<int>(std::ceil(std::max(low[0], 0.0))), y0 = static_cast<int>(std::ceil(std::max(low[1], 0.0)));
    const int x1 = static_cast<int>(std::floor(std::min(high[0], width_ - 1.0)));
    const int y1 = static_cast<int>(std::floor(std::min(high[1], height_ - 1.0)));
    const double square = step.squaredNorm();
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Vector2d at(x, y);
        const double t = std::clamp((at - a).dot(step) / square, piece.first, piece.last);
        Offer({y * width_ + x, piece.a, piece.b, t, a + t * step - at});
      }
    }
  }

  std::vector<SoftPixel> Band() const {
    std::vector<SoftPixel> band;
    for (size_t i = 0; i < squares_.size(); ++i) {
      if (squares_[i] < reach_ * reach_) band.push_back(nearest_[i]);
    }
    return band;
  }

 private:
  void Offer(const SoftPixel& point) {
    const double square = point.to_outline.squaredNorm();
    if (square < squares_[point.index]) squares_[point.index] = square, nearest_[point.index] = point;
  }

  const Eigen::Matrix2Xd& px_;
  int width_, height_;
  double reach_;
  std::vector<double> squares_;  // (H, W)
  std::vector<SoftPixel> nearest_;
};

Eigen::Matrix<double, 2, 3> Jacobian(const Eigen::Vector3f& x_in_world, const geometry::RigCamera& camera,
                                     const geometry::Projector& projector) {
  const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
  const Eigen::Vector3d x = rotation * x_in_world.cast<double>() + camera.cam_from_world.translation;
  return projector.ProjectWithJacobians(x).d_px_d_x * rotation;
}

}  // namespace

SoftCover RenderSoftCover(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen, int width_px, int height_px,
                          const SoftCoverOptions& options) {
  MVS_CHECK(options.sigma_ndc2 > 0 && options.least_share > 0 && options.least_share < 0.5,
            "sigma " << options.sigma_ndc2 << ", least share " << options.least_share);
  const double half = std::max(width_px, height_px) / 2.0;
  SoftCover soft{width_px, height_px, options.sigma_ndc2 * half * half, {}, {}, 0};
  const double reach = std::sqrt(soft.sigma_px2 * std::log(1 / options.least_share - 1));
  const MeshOutline outline = FindOutline(faces, screen, width_px, height_px, reach + 1);
  soft.skipped_faces = outline.skipped_faces;
  NearestPoints nearest(screen.px, width_px, height_px, reach);
  for (const OutlinePiece& piece : outline.pieces) nearest.Add(piece);
  soft.band = nearest.Band();
  const Image hard = FillFaces(faces, screen, width_px, height_px);
  soft.cover.assign(hard.pixels.begin(), hard.pixels.end());
  for (double& value : soft.cover) value = value > 0 ? 1 : 0;
  for (const SoftPixel& pixel : soft.band) {
    double& value = soft.cover[pixel.index];
    const double over_sigma = pixel.to_outline.squaredNorm() / soft.sigma_px2;
    value = 1 / (1 + std::exp(value > 0 ? -over_sigma : over_sigma));
  }
  return soft;
}

Eigen::Matrix2Xd SoftCoverGradient(const SoftCover& soft, const std::vector<double>& d_loss_d_cover,
                                   Eigen::Index num_vertices) {
  MVS_CHECK(d_loss_d_cover.size() == soft.cover.size(), d_loss_d_cover.size() << " derivatives for " << soft.cover.size());
  Eigen::Matrix2Xd gradient = Eigen::Matrix2Xd::Zero(2, num_vertices);
  for (const SoftPixel& pixel : soft.band) {
    const double value = soft.cover[pixel.index], sign = value >= 0.5 ? 1 : -1;
    // By the envelope theorem the nearest point's place on its edge does not matter.
    const Vector2d d = d_loss_d_cover[pixel.index] * value * (1 - value) * sign * 2 / soft.sigma_px2 * pixel.to_outline;
    gradient.col(pixel.a) += (1 - pixel.t) * d;
    gradient.col(pixel.b) += pixel.t * d;
  }
  return gradient;
}

SilhouetteTerm SilhouetteLoss(const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices_in_world,
                              const geometry::RigCamera& camera, const Image& mask, const SoftCoverOptions& options) {
  const int width = camera.camera.width_px, height = camera.camera.height_px;
  MVS_CHECK(mask.width == width && mask.height == height && mask.channels == 1,
            "a mask of " << mask.width << " x " << mask.height << " for a camera of " << width << " x " << height);
  const ScreenVertices screen = ProjectVertices(vertices_in_world, camera);
  const SoftCover soft = RenderSoftCover(faces, screen, width, height, options);
  SilhouetteTerm term{0, Eigen::Matrix3Xd::Zero(3, vertices_in_world.cols()), soft.skipped_faces};
  std::vector<double> d_cover(soft.cover.size());
  const double share = 1 / static_cast<double>(soft.cover.size());
  for (size_t i = 0; i < d_cover.size(); ++i) {
    const double difference = soft.cover[i] - mask.pixels[i] / 255.0;
    term.loss += share * difference * difference, d_cover[i] = 2 * share * difference;
  }
  const Eigen::Matrix2Xd on_screen = SoftCoverGradient(soft, d_cover, vertices_in_world.cols());
  const geometry::Projector projector(camera.camera);
  for (Eigen::Index v = 0; v < on_screen.cols(); ++v) {
    if (on_screen.col(v) != Vector2d::Zero())
      term.gradient.col(v) = Jacobian(vertices_in_world.col(v), camera, projector).transpose() * on_screen.col(v);
  }
  return term;
}

}  // namespace mvstudio::body
