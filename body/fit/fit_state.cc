#include "body/fit/fit_state.h"

#include <algorithm>
#include <cmath>

#include "body/fit/person_skeleton.h"
#include "body/surface_nets.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;

// Neighbouring vertices of an outline err together: each counts for less than a measurement of its own.
constexpr double kOutlineSigmaPx = 2, kOutlineSigmaOfPosePx = 7;
constexpr double kBrightnessShare = 0.3;  // likewise, of brightness
constexpr double kLeastJointSigmaM = 0.003;

}  // namespace

FitState::FitState(const BodyTemplate& body, const std::vector<FitStep>& steps, const BodyFitOptions& options,
                   const RunContext& run)
    : steps_(&steps), run_(run), joint_sigma_m_(options.joint_sigma_m > 0 ? options.joint_sigma_m : 0.01) {
  std::vector<JointObservation> joints;
  for (const FitStep& step : steps) {
    joints.push_back(step.joints);
    used_.emplace_back();
    for (const FitView& view : step.views) used_.back().push_back(view.held_out ? 0 : 1);
  }
  base_ = WithLengthsOf(body, joints);
  prior_ = AnatomicalPrior(base_);
  poses_.resize(steps.size()), posed_.resize(steps.size());
  FitSkeleton();
  if (options.joint_sigma_m <= 0) {
    // The norm of three normal deviates has the median 1.54 sigma.
    joint_sigma_m_ = std::clamp(joint_error_m_ / 1.54, kLeastJointSigmaM, 0.1);
    FitSkeleton();
  }
  normals_ = VertexNormals(base_.vertices, base_.faces);
  offsets_ = Eigen::VectorXd::Zero(base_.vertices.cols());
  shape_offsets_ = ShapeOffsets(base_, normals_);
  coefficients_ = Eigen::VectorXd::Zero(shape_offsets_.cols());
  laplacian_ = UmbrellaLaplacian(base_.vertices, base_.faces);
}

void FitState::FitSkeleton() {
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    PoseAllByJoints();
    std::vector<JointObservation> seen;
    std::vector<ArticulatedPose> poses;
    for (size_t i = 0; i < steps_->size(); ++i) {
      if (posed_[i]) seen.push_back((*steps_)[i].joints), poses.push_back(poses_[i]);
    }
    if (poses.empty()) return;
    MoveJointsToObserved(seen, poses, &base_);
    joint_error_m_ = MedianJointError(base_, seen, poses);
  }
}

void FitState::PoseAllByJoints() {
  const PersonBody person{base_, joint_sigma_m_, {}, {}};
  ParallelFor(static_cast<int64_t>(steps_->size()), run_.num_threads, [&](int64_t i) {
    const auto pose = PoseByJoints(person, (*steps_)[i].joints.x_in_world, (*steps_)[i].joints.valid);
    posed_[i] = pose ? 1 : 0;
    if (pose) poses_[i] = *pose;
  });
}

bool FitState::HasPoses() const {
  return std::any_of(posed_.begin(), posed_.end(), [](uint8_t posed) { return posed != 0; });
}

bool FitState::IsFitted(int step) const {
  return posed_[step] && std::find(used_[step].begin(), used_[step].end(), 1) != used_[step].end();
}

void FitState::UseAll() {
  for (size_t i = 0; i < used_.size(); ++i) {
    for (size_t k = 0; k < used_[i].size(); ++k) {
      if ((*steps_)[i].views[k].held_out) used_[i][k] = 1;
    }
  }
}

BodyTemplate FitState::Shaped() const {
  BodyTemplate shaped = base_;
  shaped.vertices += normals_ * Offsets().cast<float>().asDiagonal();
  return shaped;
}

FitState::Seen FitState::LookAtOutlines(const BodyTemplate& shaped, int step, double max_px) const {
  Seen seen;
  const PosedBones bones(shaped, poses_[step]);
  const Eigen::Matrix3Xf vertices = SkinVertices(shaped, bones.pose());
  for (size_t k = 0; k < (*steps_)[step].views.size(); ++k) {
    if (!used_[step][k]) continue;
    const FitView& view = (*steps_)[step].views[k];
    for (const RimPoint& rim : FindRim(shaped.faces, vertices, view.camera)) {
      const auto gap = view.outline->Distance(rim.px, rim.outward, max_px);
      if (!gap) continue;
      const Vector3d normal = bones.VertexRotation(rim.vertex) * normals_.col(rim.vertex).cast<double>();
      seen.shape.push_back({rim.vertex, rim.d_out_d_x * normal, *gap, 1 / kOutlineSigmaPx});
      seen.pose.push_back({rim.vertex, rim.d_out_d_x.transpose(), bones.Vertex(rim.vertex), *gap, 1 / kOutlineSigmaOfPosePx});
    }
  }
  return seen;
}

std::vector<OffsetObservation> FitState::LookAtShape(double max_px) const {
  const BodyTemplate shaped = Shaped();
  std::vector<std::vector<OffsetObservation>> seen(steps_->size());
  ParallelFor(static_cast<int64_t>(steps_->size()), run_.num_threads, [&](int64_t i) {
    if (IsFitted(static_cast<int>(i))) seen[i] = LookAtOutlines(shaped, static_cast<int>(i), max_px).shape;
  });
  std::vector<OffsetObservation> all;
  for (const auto& some : seen) all.insert(all.end(), some.begin(), some.end());
  return all;
}

Status FitState::FitShapes(double max_px) {
  return StepCoefficients(shape_offsets_, LookAtShape(max_px), base_.shapes.sigma, &coefficients_);
}

Status FitState::FitShape(double laplacian_sigma_m, double max_px) {
  constexpr double kOffsetSigmaM = 0.1;
  return StepOffsets(laplacian_, LookAtShape(max_px), {laplacian_sigma_m, kOffsetSigmaM}, &offsets_);
}

void FitState::FitPoses(double max_px) {
  constexpr int kIterations = 4;
  const BodyTemplate shaped = Shaped();
  ParallelFor(static_cast<int64_t>(steps_->size()), run_.num_threads, [&](int64_t i) {
    if (!IsFitted(static_cast<int>(i))) return;
    PoseProblemInput input{(*steps_)[i].joints, {prior_}, LookAtOutlines(shaped, static_cast<int>(i), max_px).pose};
    input.joints.sigma_m.fill(joint_sigma_m_);
    poses_[i] = SolvePose(shaped, input, poses_[i], kIterations).pose;
  });
}

FitState::SeenStep FitState::LookAtBrightness(const BodyTemplate& shaped, int step, double sigma_px) const {
  const Eigen::Matrix3Xf vertices = SkinVertices(shaped, ToBodyPose(shaped, poses_[step]));
  SeenStep seen;
  for (size_t k = 0; k < (*steps_)[step].views.size(); ++k) {
    const FitView& view = (*steps_)[step].views[k];
    if (!used_[step][k] || !view.grey) continue;
    seen.push_back(SeeVertices(shaped, vertices, view.camera, SmoothBrightness(*view.grey, view.outline->mask(), sigma_px)));
  }
  return seen;
}

FitState::MeanBrightness FitState::MeanOf(const std::vector<SeenStep>& seen) const {
  MeanBrightness mean;
  mean.value = mean.weight = Eigen::VectorXd::Zero(offsets_.size());
  const auto for_each = [&](const auto& use) {
    for (const SeenStep& step : seen) {
      for (const auto& view : step) {
        for (const SeenVertex& one : view) use(one);
      }
    }
  };
  for_each([&](const SeenVertex& one) {
    const double weight = one.weight * one.weight;
    mean.value[one.vertex] += weight * one.value, mean.weight[one.vertex] += weight;
  });
  mean.value = mean.value.cwiseQuotient(mean.weight.cwiseMax(1e-9)).eval();
  std::vector<double> deviations;
  for_each([&](const SeenVertex& one) { deviations.push_back(std::abs(one.value - mean.value[one.vertex])); });
  constexpr double kLeastSigma = 0.004;  // a grey level
  mean.sigma = std::max(kLeastSigma, kSigmaPerMad * UpperMedian(std::move(deviations), 1.0));
  return mean;
}

void FitState::AddBrightness(const BodyTemplate& shaped, int step, const SeenStep& seen, const MeanBrightness& mean,
                             std::vector<SurfaceResidual>* residuals) const {
  constexpr double kFewest = 3;  // views that a mean needs
  const PosedBones bones(shaped, poses_[step]);
  for (const auto& view : seen) {
    for (const SeenVertex& one : view) {
      if (mean.weight[one.vertex] < kFewest) continue;
      residuals->push_back({one.vertex, one.d_value_d_x.transpose(), bones.Vertex(one.vertex),
                            mean.value[one.vertex] - one.value, kBrightnessShare * one.weight / mean.sigma});
    }
  }
}

void FitState::FitBrightness(double sigma_px, double max_px) {
  constexpr int kRounds = 3, kIterations = 2;
  const BodyTemplate shaped = Shaped();
  const auto count = static_cast<int64_t>(steps_->size());
  std::vector<SeenStep> seen(steps_->size());
  ParallelFor(count, run_.num_threads, [&](int64_t i) {
    if (IsFitted(static_cast<int>(i))) seen[i] = LookAtBrightness(shaped, static_cast<int>(i), sigma_px);
  });
  const MeanBrightness mean = MeanOf(seen);
  ParallelFor(count, run_.num_threads, [&](int64_t i) {
    const auto step = static_cast<int>(i);
    if (!IsFitted(step)) return;
    for (int round = 0; round < kRounds; ++round) {
      if (round > 0) seen[i] = LookAtBrightness(shaped, step, sigma_px);
      PoseProblemInput input{(*steps_)[i].joints, {prior_}, LookAtOutlines(shaped, step, max_px).pose};
      input.joints.sigma_m.fill(joint_sigma_m_);
      AddBrightness(shaped, step, seen[i], mean, &input.surface);
      poses_[i] = SolvePose(shaped, input, poses_[i], kIterations).pose;
    }
  });
}

PersonBody FitState::Person() const {
  PersonBody person{Shaped(), joint_sigma_m_, {}, {}};
  std::vector<int> fitted;
  for (int i = 0; i < static_cast<int>(steps_->size()); ++i) {
    if (IsFitted(i)) fitted.push_back(i);
  }
  std::vector<ArticulatedPose> by_joints(fitted.size()), seen(fitted.size());
  ParallelFor(static_cast<int64_t>(fitted.size()), run_.num_threads, [&](int64_t k) {
    const JointObservation& joints = (*steps_)[fitted[k]].joints;
    seen[k] = poses_[fitted[k]];
    by_joints[k] = PoseByJoints(person, joints.x_in_world, joints.valid).value_or(seen[k]);
  });
  person.habits = RotationHabits::Learn(person.body, by_joints, seen);
  for (size_t k = 0; k < fitted.size(); ++k) person.seen[(*steps_)[fitted[k]].frame] = seen[k];
  return person;
}

}  // namespace mvstudio::body
