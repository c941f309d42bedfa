#pragma once

#include <string>
#include <vector>

#include "dataset/markers/marker_take.h"

namespace mvstudio::markers {

struct FillReport {
  int num_gaps = 0, num_positions = 0;  ///< filled
  int num_left = 0;                     ///< positions of longer gaps; a gap ends at a measured position on both sides
};

/// Fills gaps of at most `most_frames` by a cubic (Hermite; slopes at both ends from parabolas through the gap's ends and the
/// neighbour beyond, so that motions of degree two are filled exactly). What a marker lacks before its first and after its
/// last position is no gap and stays missing. The filled positions have no sigma.
FillReport FillGaps(int most_frames, MarkerTake* take);

}  // namespace mvstudio::markers
