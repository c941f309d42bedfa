#pragma once

#include <cstdint>
#include <vector>

#include "calib/board/board.h"
#include "calib/bundle/bundle.h"
#include "calib/bundle/view.h"

namespace mvstudio::bench {

/// A ring of cameras around boards that are waved in the middle, with known truth.
struct RigScene {
  calib::Board board;
  calib::RigState truth, start;  ///< the start is near the truth, as after an initialisation
  std::vector<calib::View> views;
  int num_corners = 0;
};

/// Brown lenses with four distortion terms, 1280 x 1024, standard deviation `noise_px`, a board bent by 1 mm. Frames are added
/// until there are `num_corners`.
RigScene MakeRigScene(int num_cameras, int num_corners, double noise_px, uint64_t seed);

/// One solution of a scene.
struct Solution {
  calib::BundleReport report;
  calib::RigState state;
  std::vector<calib::View> views;
  double seconds = 0;
};

/// mrcal_optimize alone: the conversion to its types and back is not counted.
Solution SolveByMrcal(const RigScene& scene, const calib::BundleOptions& options);

/// Standard deviations (worst direction, px) of the projections of points at a distance, over a grid of pixels.
struct UncertaintyMap {
  double seconds = 0;
  std::vector<double> sigma_px;  ///< row by row
};

/// Pixels of the grid, row by row: the outer ones are corners of the image.
std::vector<Eigen::Vector2d> MapPixels(const geometry::Camera& camera, int cols, int rows);

/// As mrcal's projection_uncertainty() does it: the Jacobian at the solution factored by CHOLMOD, the point carried through the
/// poses of all boards. `sigma_px` is the noise per coordinate.
UncertaintyMap MapByMrcal(const Solution& solution, const calib::Board& board, const calib::BundleOptions& options, int camera_idx,
                          int cols, int rows, double distance_m, double sigma_px);

}  // namespace mvstudio::bench
