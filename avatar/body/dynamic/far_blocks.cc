#include "avatar/body/dynamic/far_blocks.h"

#include <algorithm>
#include <numeric>

#include "avatar/body/dynamic/turn_basis.h"
#include "core/format.h"

namespace mvstudio::body {
namespace {

constexpr int kStretches = 3, kFewestSteps = 15;
constexpr double kStandardErrors = 2, kLeastShare = 0.02;

PoseBlock Stretch(const TakeOutlines& take, int begin, int end) {
  PoseBlock block{Format("frames %d to %d", take.steps[begin].step->frame, take.steps[end - 1].step->frame), {}};
  block.steps.resize(end - begin);
  std::iota(block.steps.begin(), block.steps.end(), begin);
  return block;
}

std::vector<int> Without(int count, const std::vector<int>& left_out) {
  std::vector<int> rest;
  for (int i = 0; i < count; ++i) {
    if (std::find(left_out.begin(), left_out.end(), i) == left_out.end()) rest.push_back(i);
  }
  return rest;
}

}  // namespace

std::vector<PoseBlock> FarBlocks(const TakeOutlines& take) {
  const int count = static_cast<int>(take.steps.size());
  if (count < kFewestSteps) return {};
  std::vector<ArticulatedPose> poses;
  for (const PosedStep& step : take.steps) poses.push_back(step.seen);
  const TurnBasis basis = FindTurnBasis(poses, 1);
  if (basis.size() == 0) return {};
  std::vector<PoseBlock> blocks;
  for (int k = 0; k < kStretches; ++k) blocks.push_back(Stretch(take, k * count / kStretches, (k + 1) * count / kStretches));
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::vector<double> at;
  for (const ArticulatedPose& pose : poses) at.push_back(basis.Values(pose)[0]);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return at[a] < at[b]; });
  blocks.push_back({"poses furthest to one side", {order.begin(), order.begin() + count / 5}});
  blocks.push_back({"poses furthest to the other", {order.end() - count / 5, order.end()}});
  return blocks;
}

std::vector<BlockGain> JudgeOffsets(const TakeOutlines& take, const std::vector<PoseBlock>& blocks, const TrainOffsets& train,
                                    const RunContext& run) {
  std::vector<BlockGain> gains;
  for (const PoseBlock& block : blocks) {
    const std::vector<double> still = StepLosses(take, block.steps, std::nullopt, run);
    BlockGain gain{block.name, MeanLoss(still), {}, false};
    const auto offsets = train(Without(static_cast<int>(take.steps.size()), block.steps));
    if (offsets) gain.gain = DifferenceOverUnits(still, StepLosses(take, block.steps, offsets, run));
    gain.beats = offsets && gain.gain.mean > std::max(kStandardErrors * gain.gain.standard_error, kLeastShare * gain.loss);
    gains.push_back(gain);
  }
  return gains;
}

bool BeatsEverywhere(const std::vector<BlockGain>& gains) {
  return !gains.empty() && std::all_of(gains.begin(), gains.end(), [](const BlockGain& gain) { return gain.beats; });
}

}  // namespace mvstudio::body
