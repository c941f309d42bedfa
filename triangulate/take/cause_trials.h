// Private: the steps of RankCauses, for cause*.cc.
#pragma once

#include <string>
#include <vector>

#include "triangulate/sync/sync.h"
#include "triangulate/take/cause.h"

namespace mvstudio::triangulate::internal {

/// A take modified under an assumption.
struct Assumption {
  Cause cause = Cause::kNone;
  std::string text, remedy;
  geometry::Rig rig;
  std::vector<DetectedFrame> frames;
};

/// All assumptions except those about time. `frames` is a sample.
std::vector<Assumption> Assumptions(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames,
                                    const MirrorGroups& mirror, bool alike);

/// Of them those about the detections: as shares of the image, rotated, mirrored, from below; of all cameras, of one, and
/// rotated ones of several. `alike`: of all only.
void AddDetectedChanges(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const MirrorGroups& mirror,
                        bool alike, std::vector<Assumption>* list);

/// Clocks estimated from the motion of the take, by camera; offsets and drifts are 0 where they are not significant (5 standard
/// deviations, 0.1 frames); empty when none is.
std::vector<Clock> ClocksAskedFor(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames,
                                  const CauseOptions& options, bool find_rates, const RunContext& run);
/// The assumption that these clocks hold; without frames.
Assumption WithClocks(const geometry::Rig& rig, const std::vector<Clock>& clocks);

}  // namespace mvstudio::triangulate::internal
