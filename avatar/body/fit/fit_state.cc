#include "avatar/body/fit/fit_state.h"

#include <algorithm>
#include <cmath>

#include "avatar/body/fit/person_skeleton.h"
#include "avatar/body/surface_nets.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::body {
namespace {

constexpr double kLeastJointSigmaM = 0.003;
constexpr double kOffsetSigmaM = 0.03;  // of the surface off the template's
constexpr double kShapeSigmaPx = 2;     // of an outline against the surface; neighbours err together
constexpr double kSoftestM = 3e-3;      // Laplacian of surfaces off the template's, the softest that is tried

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

std::vector<std::vector<OffsetObservation>> FitState::MeasureSteps(double max_px) const {
  const BodyTemplate shaped = Shaped();
  const StepPoser poser(shaped, joint_sigma_m_, nullptr);
  std::vector<std::vector<OffsetObservation>> seen(steps_->size());
  ParallelFor(static_cast<int64_t>(steps_->size()), run_.num_threads, [&](int64_t i) {
    if (!IsFitted(static_cast<int>(i))) return;
    const PosedBones bones(shaped, poses_[i]);
    for (const SurfaceResidual& rim : poser.MeasureOutlines((*steps_)[i], used_[i], poses_[i], max_px)) {
      const Eigen::Vector3d along = bones.VertexRotation(rim.vertex) * normals_.col(rim.vertex).cast<double>();
      seen[i].push_back({rim.vertex, rim.direction.dot(along), rim.gap, 1 / kShapeSigmaPx});
    }
  });
  return seen;
}

std::vector<OffsetObservation> FitState::MeasureShape(double max_px) const {
  std::vector<OffsetObservation> all;
  for (const auto& some : MeasureSteps(max_px)) all.insert(all.end(), some.begin(), some.end());
  return all;
}

Status FitState::FitShapes(double max_px) {
  return StepCoefficients(shape_offsets_, MeasureShape(max_px), base_.shapes.sigma, &coefficients_);
}

Status FitState::FitShape(double laplacian_sigma_m, double max_px) {
  const Status status = StepOffsets(laplacian_, MeasureShape(max_px), {laplacian_sigma_m, kOffsetSigmaM}, &offsets_);
  const Eigen::VectorXd shapes = shape_offsets_ * coefficients_;
  Eigen::VectorXd all = shapes + offsets_;
  UnfoldOffsets(base_.vertices, base_.faces, normals_, laplacian_, &all);
  offsets_ = all - shapes;
  return status;
}

Eigen::VectorXd FitState::OffsetSigma(double max_px) const {
  Eigen::VectorXd sigma = body::OffsetSigma(laplacian_, MeasureSteps(max_px), WideSmoothness(kSoftestM, kOffsetSigmaM));
  for (double& each : sigma) each = std::hypot(each, joint_sigma_m_);
  return sigma;
}

void FitState::FitPoses(double max_px) {
  const BodyTemplate shaped = Shaped();
  const StepPoser poser(shaped, joint_sigma_m_, nullptr);
  ParallelFor(static_cast<int64_t>(steps_->size()), run_.num_threads, [&](int64_t i) {
    if (IsFitted(static_cast<int>(i))) poses_[i] = poser.ByOutlines((*steps_)[i], used_[i], prior_, max_px, poses_[i]);
  });
}

MeanBrightness FitState::Brightness(const StepPoser& poser, double sigma_px) const {
  std::vector<std::vector<std::vector<SeenVertex>>> seen(steps_->size());
  ParallelFor(static_cast<int64_t>(steps_->size()), run_.num_threads, [&](int64_t i) {
    if (IsFitted(static_cast<int>(i))) seen[i] = poser.MeasureBrightness((*steps_)[i], used_[i], poses_[i], sigma_px);
  });
  return MeanOf(offsets_.size(), seen);
}

MeanBrightness FitState::Brightness(double sigma_px) const {
  const BodyTemplate shaped = Shaped();
  return Brightness(StepPoser(shaped, joint_sigma_m_, nullptr), sigma_px);
}

void FitState::FitBrightness(double sigma_px, double max_px) {
  const BodyTemplate shaped = Shaped();
  const MeanBrightness mean = Brightness(StepPoser(shaped, joint_sigma_m_, nullptr), sigma_px);
  const StepPoser poser(shaped, joint_sigma_m_, &mean);
  ParallelFor(static_cast<int64_t>(steps_->size()), run_.num_threads, [&](int64_t i) {
    if (!IsFitted(static_cast<int>(i))) return;
    poses_[i] = poser.ByBrightness((*steps_)[i], used_[i], prior_, sigma_px, max_px, poses_[i]);
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
  person.priors = LearnedRotationPrior::Learn(person.body, by_joints, seen);
  for (size_t k = 0; k < fitted.size(); ++k) person.seen[(*steps_)[fitted[k]].frame] = seen[k];
  return person;
}

}  // namespace mvstudio::body
