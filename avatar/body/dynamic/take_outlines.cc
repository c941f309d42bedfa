#include "avatar/body/dynamic/take_outlines.h"

#include <algorithm>

#include "avatar/body/fit/fit_judge.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::body {
namespace {

std::vector<uint8_t> UsedViews(const FitStep& step, const std::vector<RejectedView>& rejected) {
  std::vector<uint8_t> used;
  for (const FitView& view : step.views) {
    const bool out = std::any_of(rejected.begin(), rejected.end(), [&](const RejectedView& one) {
      return one.frame == step.frame && one.camera == view.camera_name;
    });
    used.push_back(out ? 0 : 1);
  }
  return used;
}

}  // namespace

TakeOutlines TakeOutlinesOf(const PersonBody& person, const std::vector<FitStep>& steps,
                            const std::vector<RejectedView>& rejected, const RunContext& run) {
  TakeOutlines take{person.body, person.joint_sigma_m, {}};
  take.body.shapes = {};
  for (const FitStep& step : steps) {
    const auto seen = person.seen.find(step.frame);
    std::vector<uint8_t> used = UsedViews(step, rejected);
    if (seen == person.seen.end() || std::count(used.begin(), used.end(), 1) == 0) continue;
    take.steps.push_back({&step, seen->second, seen->second, std::move(used)});
  }
  ParallelFor(static_cast<int64_t>(take.steps.size()), run.num_threads, [&](int64_t i) {
    PosedStep& step = take.steps[i];
    const JointObservation& joints = step.step->joints;
    step.by_joints = PoseByJoints(person, joints.x_in_world, joints.valid).value_or(step.seen);
  });
  return take;
}

BodyTemplate WithOffsets(const BodyTemplate& body, const Eigen::Matrix3Xf& offsets) {
  BodyTemplate moved = body;
  moved.vertices += offsets;
  return moved;
}

std::vector<double> StepLosses(const TakeOutlines& take, const std::vector<int>& indices,
                               const std::optional<PoseOffsets>& offsets, const RunContext& run) {
  std::vector<double> losses(indices.size());
  ParallelFor(static_cast<int64_t>(indices.size()), run.num_threads, [&](int64_t i) {
    const PosedStep& step = take.steps[indices[i]];
    const BodyTemplate moved = offsets ? WithOffsets(take.body, (*offsets)(step.by_joints)) : take.body;
    const std::vector<double> all = StepIous(moved, step.by_joints, *step.step);
    std::vector<double> ious;
    for (size_t k = 0; k < all.size(); ++k) {
      if (step.used[k]) ious.push_back(all[k]);
    }
    losses[i] = 1 - Mean(ious);
  });
  return losses;
}

}  // namespace mvstudio::body
