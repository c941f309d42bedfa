#pragma once

#include "avatar/body/dynamic/linear_offsets.h"
#include "avatar/body/dynamic/take_outlines.h"

namespace mvstudio::body {

struct LinearTrainingOptions {
  OffsetStiffness stiffness;
  int most_components = 6;
  int looks = 1;         ///< how often outlines are looked at, each time from the surface so far
  double most_m = 0.1;   ///< of an offset in the poses it is trained on
  double reach_px = 16;  ///< of an outline
};

/// Trains offsets linear in the bones' turns on the outlines of a take.
class LinearTraining {
 public:
  LinearTraining(const TakeOutlines& take, const RunContext& run) : take_(take), run_(run) {}

  /// On the time steps of `indices`; nothing where their poses hardly vary or the outlines tell nothing.
  std::optional<LinearOffsets> Train(const std::vector<int>& indices, const LinearTrainingOptions& options);

 private:
  std::vector<std::vector<OffsetPull>> Look(const std::vector<int>& indices, const LinearOffsets& at, double reach_px) const;
  std::vector<std::vector<OffsetPull>> MeasureStill(const std::vector<int>& indices, double reach_px);

  const TakeOutlines& take_;
  RunContext run_;
  std::vector<std::vector<OffsetPull>> still_;  // (steps) of the body as it is, for `still_reach_px_`
  double still_reach_px_ = 0;
};

}  // namespace mvstudio::body
