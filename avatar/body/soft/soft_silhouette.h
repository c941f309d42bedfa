#pragma once

#include <Eigen/Core>
#include <vector>

#include "avatar/body/fit/screen_cover.h"
#include "core/image.h"

/// A silhouette that moves smoothly with the mesh: each pixel's cover is sigmoid(s d^2 / sigma), d its distance from the
/// outline of the projected mesh, s = 1 inside and -1 outside. Liu et al., "Soft Rasterizer: a differentiable renderer for
/// image-based 3D reasoning", ICCV 2019, have this a face, and a product over faces; small faces then widen the silhouette.
/// Here the distance is that of the union of all faces.
namespace mvstudio::body {

struct SoftCoverOptions {
  double sigma_ndc2 = 1e-4;   ///< of squared distances, where the image's longer edge is 2 wide
  double least_share = 1e-4;  ///< a cover nearer than this to 0 or 1 is 0 or 1
};

/// A pixel near the outline.
struct SoftPixel {
  int index = 0;                                         ///< y * width + x
  int a = 0, b = 0;                                      ///< the edge on which the nearest point lies
  double t = 0;                                          ///< the point is a + t (b - a)
  Eigen::Vector2d to_outline = Eigen::Vector2d::Zero();  ///< px, from the pixel to that point
};

struct SoftCover {
  int width = 0, height = 0;
  double sigma_px2 = 0;
  std::vector<double> cover;    ///< (H, W) in [0, 1]
  std::vector<SoftPixel> band;  ///< pixels whose cover depends on the vertices
  int skipped_faces = 0;        ///< as MeshOutline
};

SoftCover RenderSoftCover(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen, int width_px, int height_px,
                          const SoftCoverOptions& options);

/// Gradient (2, V) with respect to ScreenVertices::px from that with respect to the cover (H, W).
Eigen::Matrix2Xd SoftCoverGradient(const SoftCover& soft, const std::vector<double>& d_loss_d_cover, Eigen::Index num_vertices);

/// Mean squared difference of cover and mask over the image.
struct SilhouetteTerm {
  double loss = 0;
  Eigen::Matrix3Xd gradient;  ///< (3, V) with respect to the vertices in world; 0 where nothing depends on a vertex
  int skipped_faces = 0;
};

/// `mask` (H, W, 1), 0 to 255, of the camera's size.
SilhouetteTerm SilhouetteLoss(const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices_in_world,
                              const geometry::RigCamera& camera, const Image& mask, const SoftCoverOptions& options);

}  // namespace mvstudio::body
