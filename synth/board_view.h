#pragma once

#include "calib/board/board.h"
#include "core/image.h"
#include "geometry/rig/rig.h"
#include "synth/lens_rays.h"

namespace mvstudio::synth {

/// A printed board prepared for rendering.
class BoardPainter {
 public:
  explicit BoardPainter(const calib::Board& board);

  /// Draws the board over `image` by exact ray-plane intersection, `samples` x `samples` samples per pixel. The back is
  /// plain card, or that of a two-sided board.
  void Draw(const geometry::Rigid3& world_from_board, const geometry::RigCamera& camera, const LensRays& rays, int samples,
            Image* image) const;

 private:
  struct Box {
    int x0, y0, x1, y1;
  };
  /// Around the side at this depth behind the front.
  Box PixelBox(const geometry::Rigid3& world_from_board, double z_m, const geometry::RigCamera& camera) const;
  float Print(double x_m, double y_m) const;

  calib::Board board_;
  Image print_;  // grey
  double px_per_m_;
  Eigen::Vector2d low_m_, high_m_;  // corners of the sheet in board
};

}  // namespace mvstudio::synth
