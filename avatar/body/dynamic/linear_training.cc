#include "avatar/body/dynamic/linear_training.h"

#include "avatar/body/fit/pose_by_images.h"
#include "core/parallel.h"

namespace mvstudio::body {
namespace {

constexpr double kOutlineSigmaPx = 2;  // of an outline against the surface; neighbours err together

std::vector<OffsetPull> PullsOf(const BodyTemplate& moved, const PosedStep& step, double joint_sigma_m, double reach_px) {
  const StepPoser poser(moved, joint_sigma_m, nullptr);
  const PosedBones bones(moved, step.seen);
  std::vector<OffsetPull> pulls;
  for (const SurfaceResidual& rim : poser.MeasureOutlines(*step.step, step.used, step.seen, reach_px)) {
    const Eigen::Vector3d direction = bones.VertexRotation(rim.vertex).transpose() * rim.direction;
    pulls.push_back({rim.vertex, direction, rim.gap, 1 / kOutlineSigmaPx});
  }
  return pulls;
}

}  // namespace

std::vector<std::vector<OffsetPull>> LinearTraining::Look(const std::vector<int>& indices, const LinearOffsets& at,
                                                          double reach_px) const {
  std::vector<std::vector<OffsetPull>> pulls(indices.size());
  ParallelFor(static_cast<int64_t>(indices.size()), run_.num_threads, [&](int64_t i) {
    const PosedStep& step = take_.steps[indices[i]];
    pulls[i] = PullsOf(WithOffsets(take_.body, at.At(step.seen)), step, take_.joint_sigma_m, reach_px);
  });
  return pulls;
}

std::vector<std::vector<OffsetPull>> LinearTraining::MeasureStill(const std::vector<int>& indices, double reach_px) {
  if (still_reach_px_ != reach_px) {
    still_.assign(take_.steps.size(), {}), still_reach_px_ = reach_px;
    ParallelFor(static_cast<int64_t>(still_.size()), run_.num_threads,
                [&](int64_t i) { still_[i] = PullsOf(take_.body, take_.steps[i], take_.joint_sigma_m, reach_px); });
  }
  std::vector<std::vector<OffsetPull>> pulls;
  for (const int i : indices) pulls.push_back(still_[i]);
  return pulls;
}

std::optional<LinearOffsets> LinearTraining::Train(const std::vector<int>& indices, const LinearTrainingOptions& options) {
  std::vector<ArticulatedPose> poses;
  for (const int i : indices) poses.push_back(take_.steps[i].seen);
  LinearOffsets out{FindTurnBasis(poses, options.most_components), {}};
  if (out.basis.size() == 0) return std::nullopt;
  out.weights = Eigen::MatrixXd::Zero(take_.body.vertices.cols(), 3 * out.basis.size());
  std::vector<Eigen::VectorXd> values;
  for (const ArticulatedPose& pose : poses) values.push_back(out.basis.Values(pose));
  const Eigen::SparseMatrix<double> stiffness = StiffnessMatrix(take_.body.vertices, take_.body.faces, options.stiffness);
  for (int look = 0; look < options.looks; ++look) {
    const auto pulls = look == 0 ? MeasureStill(indices, options.reach_px) : Look(indices, out, options.reach_px);
    if (StepWeights(stiffness, pulls, values, &out.weights) != Status::kOk) return std::nullopt;
    LimitOffsets(values, options.most_m, &out.weights);
  }
  return out;
}

}  // namespace mvstudio::body
