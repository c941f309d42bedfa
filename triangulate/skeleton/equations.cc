#include <cmath>
#include <limits>

#include "triangulate/skeleton/problem.h"

namespace mvstudio::triangulate::internal {

double Loss(double squared, double sigmas) { return sigmas * sigmas * std::log1p(squared / (sigmas * sigmas)); }
double Weight(double squared, double sigmas) { return 1 / (1 + squared / (sigmas * sigmas)); }

namespace {

std::vector<int> Widths(const SkeletonProblem& problem) {
  std::vector<int> widths(static_cast<size_t>(problem.num_positions), 3);
  widths.resize(widths.size() + static_cast<size_t>(problem.num_lengths), 1);
  return widths;
}

std::vector<std::pair<int, int>> Couplings(const SkeletonProblem& problem) {
  std::vector<std::pair<int, int>> couplings;
  for (const Triple& triple : problem.triples) {
    const int a = problem.variable[triple.cell[0]], b = problem.variable[triple.cell[1]], c = problem.variable[triple.cell[2]];
    couplings.insert(couplings.end(), {{a, b}, {a, c}, {b, c}});
  }
  for (const Bone& bone : problem.bones) {
    const int a = problem.variable[bone.cell_a], b = problem.variable[bone.cell_b], length = problem.length_node[bone.bone];
    couplings.insert(couplings.end(), {{a, b}, {a, length}, {b, length}});
  }
  return couplings;
}

}  // namespace

Equations::Equations(const SkeletonProblem& problem)
    : problem_(problem), matrix_(Widths(problem), EliminationGroups(problem), Couplings(problem)) {
  const auto of = [&problem](size_t cell) { return problem.variable[cell]; };
  for (int node = 0; node < problem.num_positions + problem.num_lengths; ++node) diagonal_.push_back(matrix_.Find(node, node));
  for (const Triple& t : problem.triples) {
    triples_.push_back({matrix_.Find(of(t.cell[1]), of(t.cell[0])), matrix_.Find(of(t.cell[2]), of(t.cell[0])),
                        matrix_.Find(of(t.cell[2]), of(t.cell[1]))});
  }
  for (const Bone& bone : problem.bones) {
    const int length = problem.length_node[bone.bone];
    bones_.push_back({matrix_.Find(of(bone.cell_a), of(bone.cell_b)), matrix_.Find(of(bone.cell_a), length),
                      matrix_.Find(of(bone.cell_b), length)});
  }
}

bool Equations::AddDetections(const Unknowns& at, bool want_matrix, double* cost) {
  for (const Seen& seen : problem_.seen) {
    const Observation& observation = problem_.window->cells[seen.cell].observations[seen.observation];
    const PreparedCamera& camera = problem_.rig->cameras[static_cast<size_t>(observation.camera_idx)];
    const auto projection = camera.projector.ProjectWithJacobians(camera.ToCam(at.x_in_local[seen.cell]));
    if (projection.status != Status::kOk) {
      if (problem_.terms->robust) continue;  // a detection that cannot be of this point
      return false;
    }
    const Eigen::Vector2d residual = (projection.px - observation.px) / observation.sigma_px;
    const double squared = residual.squaredNorm();
    *cost += problem_.terms->robust ? Loss(squared, kRobustSigmas) : squared;
    if (!want_matrix) continue;
    const double weight = problem_.terms->robust ? Weight(squared, kRobustSigmas) : 1;
    const Eigen::Matrix<double, 2, 3> jacobian = projection.d_px_d_x * camera.cam_from_local_rotation / observation.sigma_px;
    const int node = problem_.variable[seen.cell];
    gradient_.segment<3>(3 * node) += weight * jacobian.transpose() * residual;
    BlockAt(diagonal_[static_cast<size_t>(node)]) += weight * jacobian.transpose() * jacobian;
  }
  return true;
}

/// The axes do not mix: the blocks are multiples of the identity.
void Equations::AddAccelerations(const Unknowns& at, bool want_matrix, double* cost) {
  for (size_t i = 0; i < problem_.triples.size(); ++i) {
    const Triple& triple = problem_.triples[i];
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) residual += triple.c[k] * at.x_in_local[triple.cell[k]];
    const double squared = residual.squaredNorm(), weight = Weight(squared, kTermSigmas);
    *cost += Loss(squared, kTermSigmas);
    if (!want_matrix) continue;
    for (int a = 0; a < 3; ++a) {
      const int node = problem_.variable[triple.cell[a]];
      gradient_.segment<3>(3 * node) += weight * triple.c[a] * residual;
      BlockAt(diagonal_[static_cast<size_t>(node)]).diagonal().array() += weight * triple.c[a] * triple.c[a];
      for (int b = 0; b < a; ++b) {
        BlockAt(triples_[i][static_cast<size_t>(a + b - 1)]).diagonal().array() += weight * triple.c[a] * triple.c[b];
      }
    }
  }
}

void Equations::AddBones(const Unknowns& at, bool want_matrix, double* cost) {
  for (size_t i = 0; i < problem_.bones.size(); ++i) {
    const Bone& bone = problem_.bones[i];
    const Eigen::Vector3d difference = at.x_in_local[bone.cell_a] - at.x_in_local[bone.cell_b];
    const double length = difference.norm(), sigma = problem_.terms->bone_lengths * (*problem_.known)[bone.bone].length_m;
    if (!(length > 1e-9)) continue;
    const double residual = (length - at.length_m[bone.bone]) / sigma;
    *cost += Loss(residual * residual, kTermSigmas);
    if (!want_matrix) continue;
    const double weight = Weight(residual * residual, kTermSigmas);
    const Eigen::Vector3d by_a = difference / length / sigma;  // by_b = -by_a, by the length -1 / sigma
    const Eigen::Matrix3d square = weight * by_a * by_a.transpose();
    const int a = problem_.variable[bone.cell_a], b = problem_.variable[bone.cell_b];
    gradient_.segment<3>(3 * a) += weight * residual * by_a;
    gradient_.segment<3>(3 * b) -= weight * residual * by_a;
    gradient_[problem_.LengthRow(bone.bone)] -= weight * residual / sigma;
    BlockAt(diagonal_[static_cast<size_t>(a)]) += square;
    BlockAt(diagonal_[static_cast<size_t>(b)]) += square;
    BlockAt(bones_[i][0]) -= square;
    RowAt(bones_[i][1]) -= weight / sigma * by_a;
    RowAt(bones_[i][2]) += weight / sigma * by_a;
    *matrix_.At(diagonal_[static_cast<size_t>(problem_.length_node[bone.bone])]) += weight / (sigma * sigma);
  }
  for (size_t b = 0; b < problem_.length_node.size(); ++b) {
    if (problem_.length_node[b] < 0) continue;
    const KnownLength& known = (*problem_.known)[b];
    const double residual = (at.length_m[b] - known.length_m) / known.sigma_m;
    *cost += residual * residual;
    if (!want_matrix) continue;
    gradient_[problem_.LengthRow(b)] += residual / known.sigma_m;
    *matrix_.At(diagonal_[static_cast<size_t>(problem_.length_node[b])]) += 1 / (known.sigma_m * known.sigma_m);
  }
}

double Equations::Sum(const Unknowns& at, bool want_matrix) {
  if (want_matrix) matrix_.SetZero(), gradient_ = Eigen::VectorXd::Zero(problem_.size());
  double cost = 0;
  if (!AddDetections(at, want_matrix, &cost)) return std::numeric_limits<double>::infinity();
  AddAccelerations(at, want_matrix, &cost);
  AddBones(at, want_matrix, &cost);
  return cost;
}

std::optional<Eigen::VectorXd> Equations::Step() {
  if (!matrix_.Factor()) return std::nullopt;
  Eigen::VectorXd step = -matrix_.Solve(gradient_);
  if (!step.allFinite()) return std::nullopt;
  return step;
}

}  // namespace mvstudio::triangulate::internal
