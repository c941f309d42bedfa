#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "dataset/masks.h"

/// Pieces of the mask code that are shared by its files and not part of the module's public face.
namespace mvstudio::dataset::internal {

struct LimbDistance {
  double outside_m = std::numeric_limits<double>::infinity();  ///< to the nearest limb's surface, negative inside
  double relative = std::numeric_limits<double>::infinity();   ///< to the nearest limb's axis over its radius
};
LimbDistance DistanceToBody(const ProjectedBody& body, const Eigen::Vector2d& px);

/// Mean over the limbs; the body must not be empty.
double TypicalPxPerM(const ProjectedBody& body);

/// Half-open pixel ranges.
struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool empty() const { return width() <= 0 || height() <= 0; }
};
/// Bounding box of the region within `margin_m` of the limbs, clipped to the image.
PixelBox BoxOfBody(const ProjectedBody& body, int width, int height, double margin_m);

/// Colour's evidence for a person at a pixel of the frame, nats, clamped to +-8.
double PersonEvidence(const Image& rgb, int x, int y, const CameraMaskModel& model);

enum class Label : int8_t { kFree = -1, kBackground = 0, kPerson = 1 };

/// One cut on a grid: costs in nats, row-major.
struct CutProblem {
  int width = 0, height = 0;
  std::vector<float> person_cost, background_cost;  // (H, W), read at free pixels only
  std::vector<Label> label;                         // (H, W) free or decided
  std::vector<float> contrast2_x, contrast2_y, contrast2_d,
      contrast2_u;            // (H, W) squared colour step to the right, below, below right, below left
  double mean_contrast2 = 1;  ///< scale of the squared steps
  double smoothness = 0;
};
/// Decides every free pixel. Boykov and Kolmogorov, PAMI 2004.
void SolveCut(CutProblem* problem);

}  // namespace mvstudio::dataset::internal
