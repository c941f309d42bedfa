// Private: the steps of RankCauses, for cause*.cc.
#pragma once

#include <string>
#include <vector>

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
                                    const MirrorGroups& mirror);

/// Time offsets estimated from the motion of the take, by camera, frames; 0 where it is not significant
/// (5 standard deviations, 0.1 frames); empty when none is.
std::vector<double> OffsetsAskedFor(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames,
                                    const CauseOptions& options, const RunContext& run);
/// "with cam_2 61 frames later".
std::string OffsetText(const geometry::Rig& rig, const std::vector<double>& offset_frames);

}  // namespace mvstudio::triangulate::internal
