#include "avatar/body/fit/rotation_prior.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace mvstudio::body {
namespace {

using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// The bone, its children, its parent and the parent of that.
std::vector<int> Neighbours(const BodyTemplate& body, int bone) {
  std::vector<int> near = {bone};
  for (int b = body.bone_parents[bone], k = 0; b >= 0 && k < 2; b = body.bone_parents[b], ++k) near.push_back(b);
  for (size_t b = 0; b < body.bone_parents.size(); ++b) {
    if (body.bone_parents[b] == bone) near.push_back(static_cast<int>(b));
  }
  return near;
}

/// 1, the direction of up in the bone's axes, and the neighbours' rotations; the root's is none: people turn.
VectorXd Features(const BodyTemplate& body, const ArticulatedPose& pose, const BodyPose& world, int bone) {
  const std::vector<int> near = Neighbours(body, bone);
  VectorXd out(LearnedRotationPrior::NumFeatures(body, bone));
  out[0] = 1;
  out.segment<3>(1) = world.bone_transforms[bone].rotation.conjugate() * Vector3d::UnitZ() - Vector3d::UnitZ();
  for (size_t k = 0; k < near.size(); ++k) {
    const bool root = body.bone_parents[near[k]] < 0;
    out.segment<3>(static_cast<Eigen::Index>(4 + 3 * k)) =
        root ? Vector3d::Zero() : geometry::RotationLog(pose.local_rotations[near[k]]);
  }
  return out;
}

/// Weights (3, F) of targets (3, N) by features (F, N); the constant is free.
MatrixXd Ridge(const MatrixXd& features, const MatrixXd& targets, double strength) {
  MatrixXd h = features * features.transpose();
  h.diagonal().tail(h.rows() - 1).array() += strength;
  h(0, 0) += 1e-6;
  return h.ldlt().solve(features * targets.transpose()).transpose();
}

MatrixXd Columns(const MatrixXd& from, const std::vector<int>& columns) {
  MatrixXd out(from.rows(), static_cast<Eigen::Index>(columns.size()));
  for (size_t i = 0; i < columns.size(); ++i) out.col(static_cast<Eigen::Index>(i)) = from.col(columns[i]);
  return out;
}

/// Mean squared error in time steps left out, a contiguous block at a time.
double LeftOutError(const MatrixXd& features, const MatrixXd& targets, double strength) {
  constexpr int kBlocks = 5;
  const auto count = static_cast<int>(targets.cols());
  double sum = 0;
  for (int block = 0; block < kBlocks; ++block) {
    std::vector<int> in, out;
    for (int i = 0; i < count; ++i) (i * kBlocks / count == block ? out : in).push_back(i);
    const MatrixXd weights = Ridge(Columns(features, in), Columns(targets, in), strength);
    sum += (Columns(targets, out) - weights * Columns(features, out)).squaredNorm();
  }
  return sum / count;
}

/// From the mean alone to nearly no restraint; a freer one must be better by 5 %.
LearnedRotationPrior::Bone LearnBone(const MatrixXd& features, const MatrixXd& targets) {
  constexpr double kMeanAlone = 1e9, kGain = 0.95;
  LearnedRotationPrior::Bone bone;
  double least = targets.squaredNorm() / static_cast<double>(targets.cols());
  for (const double strength : {kMeanAlone, 30., 10., 3., 1., 0.3, 0.1, 0.03}) {
    const double error = LeftOutError(features, targets, strength);
    if (error < kGain * least) least = error, bone.weights = Ridge(features, targets, strength);
  }
  bone.sigma_rad = std::sqrt(least);
  return bone;
}

}  // namespace

Eigen::Index LearnedRotationPrior::NumFeatures(const BodyTemplate& body, int bone) {
  return 4 + 3 * static_cast<Eigen::Index>(Neighbours(body, bone).size());
}

LearnedRotationPrior LearnedRotationPrior::Learn(const BodyTemplate& body, const std::vector<ArticulatedPose>& by_joints,
                                                 const std::vector<ArticulatedPose>& seen) {
  constexpr size_t kFewest = 20;
  LearnedRotationPrior priors;
  if (seen.size() < kFewest) return priors;
  std::vector<BodyPose> world;
  for (const ArticulatedPose& pose : by_joints) world.push_back(ToBodyPose(body, pose));
  for (int b = 0; b < static_cast<int>(body.bone_names.size()); ++b) {
    MatrixXd features(Features(body, by_joints[0], world[0], b).size(), seen.size()), targets(3, seen.size());
    for (size_t i = 0; i < seen.size(); ++i) {
      const auto column = static_cast<Eigen::Index>(i);
      features.col(column) = Features(body, by_joints[i], world[i], b);
      targets.col(column) = geometry::RotationLog(by_joints[i].local_rotations[b].conjugate() * seen[i].local_rotations[b]);
    }
    priors.bones.push_back(LearnBone(features, targets));
  }
  return priors;
}

RotationPrior LearnedRotationPrior::Expect(const BodyTemplate& body, const ArticulatedPose& by_joints) const {
  constexpr double kLeastSigma = 0.05;  // rad
  const BodyPose world = ToBodyPose(body, by_joints);
  RotationPrior prior;
  prior.mean = by_joints.local_rotations;
  for (size_t b = 0; b < bones.size(); ++b) {
    prior.weight.push_back(Eigen::Matrix3d::Identity() / std::max(kLeastSigma, bones[b].sigma_rad));
    if (bones[b].weights.size() == 0) continue;
    const Vector3d turn = bones[b].weights * Features(body, by_joints, world, static_cast<int>(b));
    prior.mean[b] = prior.mean[b] * geometry::RotationExp(turn);
  }
  return prior;
}

}  // namespace mvstudio::body
