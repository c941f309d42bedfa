#include "avatar/body/fit/pose_by_images.h"

#include <cmath>
#include <mutex>

#include "avatar/body/fit/fit_judge.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::body {
namespace {

// Neighbouring vertices of an outline err together: each counts for less than a measurement of its own.
constexpr double kOutlineSigmaPx = 7;
constexpr double kBrightnessShare = 0.3;  // likewise, of brightness
constexpr double kReachesPx[] = {24, 12, 12};
constexpr double kBrightnessSigmaPx[] = {4, 2};

double MeanOfUsed(const std::vector<double>& ious, const std::vector<uint8_t>& used) {
  std::vector<double> some;
  for (size_t k = 0; k < ious.size(); ++k) {
    if (used[k]) some.push_back(ious[k]);
  }
  return Mean(some);
}

/// Coarse to fine, from the pose by joints.
ArticulatedPose FromJoints(const StepPoser& poser, bool brightness, const FitStep& step, const std::vector<uint8_t>& used,
                           const ExpectedPose& by_joints) {
  ArticulatedPose pose = by_joints.pose;
  for (const double reach_px : kReachesPx) pose = poser.ByOutlines(step, used, by_joints.prior, reach_px, pose);
  if (!brightness) return pose;
  for (const double sigma_px : kBrightnessSigmaPx)
    pose = poser.ByBrightness(step, used, by_joints.prior, sigma_px, kReachesPx[2], pose);
  return pose;
}

}  // namespace

StepPoser::StepPoser(const BodyTemplate& body, double joint_sigma_m, const MeanBrightness* brightness)
    : body_(&body), brightness_(brightness), joint_sigma_m_(joint_sigma_m) {}

std::vector<SurfaceResidual> StepPoser::MeasureOutlines(const FitStep& step, const std::vector<uint8_t>& used,
                                                        const ArticulatedPose& pose, double max_px) const {
  std::vector<SurfaceResidual> seen;
  const PosedBones bones(*body_, pose);
  const Eigen::Matrix3Xf vertices = SkinVertices(*body_, bones.pose());
  for (size_t k = 0; k < step.views.size(); ++k) {
    if (!used[k]) continue;
    const FitView& view = step.views[k];
    for (const RimPoint& rim : FindRim(body_->faces, vertices, view.camera)) {
      const auto gap = view.outline->Distance(rim.px, rim.outward, max_px);
      if (gap) seen.push_back({rim.vertex, rim.d_out_d_x.transpose(), bones.Vertex(rim.vertex), *gap, 1 / kOutlineSigmaPx});
    }
  }
  return seen;
}

std::vector<std::vector<SeenVertex>> StepPoser::MeasureBrightness(const FitStep& step, const std::vector<uint8_t>& used,
                                                                  const ArticulatedPose& pose, double sigma_px) const {
  const Eigen::Matrix3Xf vertices = SkinVertices(*body_, ToBodyPose(*body_, pose));
  std::vector<std::vector<SeenVertex>> seen;
  for (size_t k = 0; k < step.views.size(); ++k) {
    const FitView& view = step.views[k];
    if (!used[k] || !view.grey) continue;
    seen.push_back(SeeVertices(*body_, vertices, view.camera, SmoothBrightness(*view.grey, view.outline->mask(), sigma_px)));
  }
  return seen;
}

PoseProblemInput StepPoser::Outlines(const FitStep& step, const std::vector<uint8_t>& used, const RotationPrior& prior,
                                     double max_px, const ArticulatedPose& pose) const {
  PoseProblemInput input{step.joints, {prior}, MeasureOutlines(step, used, pose, max_px)};
  input.joints.sigma_m.fill(joint_sigma_m_);
  return input;
}

void StepPoser::AddBrightness(const FitStep& step, const std::vector<uint8_t>& used, double sigma_px,
                              const ArticulatedPose& pose, std::vector<SurfaceResidual>* residuals) const {
  constexpr double kFewest = 3;  // views that a mean needs
  const PosedBones bones(*body_, pose);
  for (const auto& view : MeasureBrightness(step, used, pose, sigma_px)) {
    for (const SeenVertex& one : view) {
      if (brightness_->weight[one.vertex] < kFewest) continue;
      residuals->push_back({one.vertex, one.d_value_d_x.transpose(), bones.Vertex(one.vertex),
                            brightness_->value[one.vertex] - one.value, kBrightnessShare * one.weight / brightness_->sigma});
    }
  }
}

ArticulatedPose StepPoser::ByOutlines(const FitStep& step, const std::vector<uint8_t>& used, const RotationPrior& prior,
                                      double max_px, const ArticulatedPose& pose) const {
  constexpr int kIterations = 4;
  return SolvePose(*body_, Outlines(step, used, prior, max_px, pose), pose, kIterations).pose;
}

ArticulatedPose StepPoser::ByBrightness(const FitStep& step, const std::vector<uint8_t>& used, const RotationPrior& prior,
                                        double sigma_px, double max_px, const ArticulatedPose& pose) const {
  constexpr int kRounds = 3, kIterations = 2;
  ArticulatedPose better = pose;
  for (int round = 0; round < kRounds; ++round) {
    PoseProblemInput input = Outlines(step, used, prior, max_px, better);
    AddBrightness(step, used, sigma_px, better, &input.surface);
    better = SolvePose(*body_, input, better, kIterations).pose;
  }
  return better;
}

StepPoses PoseByImages(const PersonBody& person, const MeanBrightness* brightness, const std::vector<FitStep>& steps,
                       const RunContext& run) {
  const StepPoser poser(person.body, person.joint_sigma_m, brightness);
  std::vector<std::optional<ExpectedPose>> poses(steps.size());
  std::vector<std::vector<double>> ious(steps.size());
  std::vector<std::vector<uint8_t>> used(steps.size());
  const auto count = static_cast<int64_t>(steps.size());
  ProgressStage stage(run, "posing by images", count);
  std::mutex mutex;
  ParallelFor(count, run.num_threads, [&](int64_t i) {
    poses[i] = ExpectByJoints(person, steps[i].joints.x_in_world, steps[i].joints.valid);
    if (!poses[i]) return;
    used[i].assign(steps[i].views.size(), 1);
    ious[i] = StepIous(person.body, poses[i]->pose, steps[i]);
  });
  StepPoses out;
  out.rejected = RejectViews(steps, ious, &used);
  std::vector<double> before(steps.size(), std::nan("")), after = before;
  ParallelFor(count, run.num_threads, [&](int64_t i) {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      stage.Advance();
    }
    before[i] = after[i] = MeanOfUsed(ious[i], used[i]);
    if (!std::isfinite(before[i])) return;
    const ArticulatedPose pose = FromJoints(poser, brightness != nullptr, steps[i], used[i], *poses[i]);
    const double iou = MeanOfUsed(StepIous(person.body, pose, steps[i]), used[i]);
    if (iou > before[i]) poses[i]->pose = pose, after[i] = iou;
  });
  for (size_t i = 0; i < steps.size(); ++i) {
    if (poses[i]) out.poses[steps[i].frame] = poses[i]->pose;
  }
  out.iou_before = FiniteValues(before), out.iou = FiniteValues(after);
  return out;
}

}  // namespace mvstudio::body
