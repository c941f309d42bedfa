// Private: for the .cc files of the masks.
#pragma once

#include <cstdint>
#include <vector>

namespace mvstudio::dataset::internal {

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
