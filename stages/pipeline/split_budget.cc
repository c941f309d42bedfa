#include "stages/pipeline/split_budget.h"

#include <algorithm>

#include "core/error.h"
#include "stages/budget/ask.h"

namespace mvstudio::stages {
namespace {

constexpr double kQuickStage = 5;  // s

/// Of a session of a few minutes: a board of a minute, keypoints of a take, its points.
double UsualShare(StageKind kind) { return kind == StageKind::kPose2d ? 6 : 1; }

bool IsSlow(StageKind kind) {
  return kind == StageKind::kMask || kind == StageKind::kDataset || kind == StageKind::kAvatar || kind == StageKind::kEval;
}

bool IsShared(const StageTime& stage) { return TakesBudget(stage.kind) && !stage.has_own_budget; }

/// Of the stages whose time is not `run`'s to choose.
double FixedSeconds(const std::vector<StageTime>& to_do, const std::string& asked) {
  double seconds = 0;
  for (const StageTime& stage : to_do) {
    if (IsShared(stage)) continue;
    if (std::isnan(stage.seconds) && IsSlow(stage.kind)) {
      throw UsageError(
          "option 'budget' " + asked + ": nothing says how long " + stage.name +
          " takes, which has no budget of its own; run it once without, or end before it (option 'to' triangulate)");
    }
    seconds += std::isnan(stage.seconds) ? kQuickStage : stage.seconds;
  }
  return seconds;
}

}  // namespace

bool TakesBudget(StageKind kind) {
  return kind == StageKind::kCalibrate || kind == StageKind::kPose2d || kind == StageKind::kTriangulate;
}

bool HasOwnBudget(const PipelineStage& stage) {
  return std::any_of(stage.options.begin(), stage.options.end(), [](const auto& option) { return option.name == "budget"; });
}

double StageBudget(const std::vector<StageTime>& to_do, double left_s, const std::string& asked) {
  if (to_do.empty() || !IsShared(to_do.front())) return std::nan("");
  const bool measured =
      std::none_of(to_do.begin(), to_do.end(), [](const StageTime& stage) { return IsShared(stage) && !(stage.seconds > 0); });
  const auto weight = [&](const StageTime& stage) { return measured ? stage.seconds : UsualShare(stage.kind); };
  double weights = 0;
  for (const StageTime& stage : to_do) weights += IsShared(stage) ? weight(stage) : 0;
  const double fixed_s = FixedSeconds(to_do, asked), shared_s = left_s - fixed_s;
  if (!(shared_s > 0)) {
    throw UsageError("option 'budget' " + asked + ": nothing is left for " + to_do.front().name + "; " +
                     (fixed_s > 0 ? "stages without a budget take about " + SecondsText(fixed_s) + "; " : "") +
                     "give more time");
  }
  return shared_s * weight(to_do.front()) / weights;
}

}  // namespace mvstudio::stages
