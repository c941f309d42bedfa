#pragma once

#include <functional>
#include <string>
#include <vector>

#include "avatar/body/dynamic/take_outlines.h"
#include "core/choice/heldout_choice.h"

/// Whether a surface that moves with the pose says something of other motions: it is trained without blocks of the take whose
/// poses are far from the others, and must beat skinning in each of them.
namespace mvstudio::body {

struct PoseBlock {
  std::string name;
  std::vector<int> steps;  ///< indices into TakeOutlines::steps
};

/// Three stretches of time, and the fifths of the time steps that lie furthest to either side along the component in which the
/// poses vary most. Empty with fewer than 15 time steps, or where the poses hardly vary.
std::vector<PoseBlock> FarBlocks(const TakeOutlines& take);

/// One block, by surfaces that were trained without it.
struct BlockGain {
  std::string name;
  double loss = 0;  ///< mean of skinning alone, one minus IoU
  UnitMean gain;    ///< what the moving surface takes off it, over time steps
  bool beats = false;
};

/// Trains on the time steps of `indices`; nothing where it cannot.
using TrainOffsets = std::function<std::optional<PoseOffsets>(const std::vector<int>& indices)>;

/// Gains in every block. A surface beats skinning in a block where its gain is over two standard errors and over 2 % of
/// the loss.
std::vector<BlockGain> JudgeOffsets(const TakeOutlines& take, const std::vector<PoseBlock>& blocks, const TrainOffsets& train,
                                    const RunContext& run);

/// Whether a surface beats skinning in all blocks, at least one.
bool BeatsEverywhere(const std::vector<BlockGain>& gains);

}  // namespace mvstudio::body
