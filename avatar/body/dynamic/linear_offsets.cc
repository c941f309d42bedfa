#include "avatar/body/dynamic/linear_offsets.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "avatar/body/fit/offsets.h"
#include "core/check.h"

namespace mvstudio::body {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

constexpr int kReweightings = 3, kMostIterations = 60;
constexpr double kTolerance = 1e-4;

/// Of a Cauchy loss at three standard deviations, for a gap that is left.
double RobustWeight(const OffsetPull& pull, double gap_px) {
  constexpr double kCauchy = 3;
  const double square = pull.weight * pull.weight;
  return square / (1 + square * gap_px * gap_px / (kCauchy * kCauchy));
}

Eigen::Vector3d OffsetOf(const Eigen::MatrixXd& weights, int vertex, const Eigen::VectorXd& values) {
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  for (Eigen::Index k = 0; k < values.size(); ++k) offset += values[k] * weights.row(vertex).segment<3>(3 * k).transpose();
  return offset;
}

/// sum over edges of |w_a - w_b|^2 / length^2, each edge once for each of its faces.
Sparse StrainMatrix(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces) {
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int a = faces(k, f), b = faces((k + 1) % 3, f);
      const double share = 0.5 / std::max(1e-8, static_cast<double>((vertices.col(a) - vertices.col(b)).squaredNorm()));
      entries.emplace_back(a, a, share), entries.emplace_back(b, b, share);
      entries.emplace_back(a, b, -share), entries.emplace_back(b, a, -share);
    }
  }
  Sparse strain(vertices.cols(), vertices.cols());
  strain.setFromTriplets(entries.begin(), entries.end());
  return strain;
}

/// The pulls as a linear problem in the step of the weights.
class Pulls {
 public:
  Pulls(const std::vector<std::vector<OffsetPull>>& pulls, const std::vector<Eigen::VectorXd>& values, Eigen::Index count)
      : pulls_(pulls), values_(values), count_(count) {}

  /// Weights for the gaps that `step` (V, 3 K) leaves.
  void Reweight(const Eigen::MatrixXd& step) {
    robust_.clear();
    ForEach([&](const OffsetPull& pull, const Eigen::VectorXd& values) {
      robust_.push_back(RobustWeight(pull, pull.gap_px - pull.direction.dot(OffsetOf(step, pull.vertex, values))));
    });
  }

  /// J^T W gap.
  Eigen::MatrixXd Force() const {
    return Sum([](const OffsetPull& pull, const Eigen::VectorXd&) { return pull.gap_px; });
  }
  /// J^T W J step.
  Eigen::MatrixXd Times(const Eigen::MatrixXd& step) const {
    return Sum([&](const OffsetPull& pull, const Eigen::VectorXd& values) {
      return pull.direction.dot(OffsetOf(step, pull.vertex, values));
    });
  }
  /// Mean over each vertex's diagonal of J^T W J.
  Eigen::VectorXd MeanDiagonal() const {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(count_);
    size_t at = 0;
    ForEach([&](const OffsetPull& pull, const Eigen::VectorXd& values) {
      mean[pull.vertex] +=
          robust_[at++] * pull.direction.squaredNorm() * values.squaredNorm() / static_cast<double>(3 * values.size());
    });
    return mean;
  }

 private:
  template <class Use>
  void ForEach(const Use& use) const {
    for (size_t i = 0; i < pulls_.size(); ++i) {
      for (const OffsetPull& pull : pulls_[i]) use(pull, values_[i]);
    }
  }

  template <class Residual>
  Eigen::MatrixXd Sum(const Residual& residual) const {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(3 * NumValues(), count_);  // a vertex a column: its entries lie together
    size_t at = 0;
    ForEach([&](const OffsetPull& pull, const Eigen::VectorXd& values) {
      const double force = robust_[at++] * residual(pull, values);
      for (Eigen::Index k = 0; k < values.size(); ++k)
        sum.col(pull.vertex).segment<3>(3 * k) += force * values[k] * pull.direction;
    });
    return sum.transpose();
  }

  Eigen::Index NumValues() const {
    Eigen::Index most = 0;
    for (const Eigen::VectorXd& values : values_) most = std::max(most, values.size());
    return most;
  }

  const std::vector<std::vector<OffsetPull>>& pulls_;
  const std::vector<Eigen::VectorXd>& values_;
  Eigen::Index count_;
  std::vector<double> robust_;
};

/// (stiffness + pulls) x = force, all columns at once.
Status ConjugateGradients(const Sparse& stiffness, const Pulls& pulls, const Eigen::MatrixXd& force, Eigen::MatrixXd* x) {
  const Eigen::SimplicialLDLT<Sparse> near(stiffness + Sparse(pulls.MeanDiagonal().asDiagonal()));
  if (near.info() != Eigen::Success) return Status::kDegenerate;
  const auto times = [&](const Eigen::MatrixXd& y) -> Eigen::MatrixXd { return stiffness * y + pulls.Times(y); };
  Eigen::MatrixXd left = force - times(*x), direction = near.solve(left), solved = direction;
  double power = left.cwiseProduct(solved).sum();
  const double enough = kTolerance * kTolerance * force.cwiseProduct(near.solve(force)).sum();
  for (int i = 0; i < kMostIterations && power > enough; ++i) {
    const Eigen::MatrixXd image = times(direction);
    const double step = power / direction.cwiseProduct(image).sum();
    *x += step * direction, left -= step * image;
    solved = near.solve(left);
    const double next = left.cwiseProduct(solved).sum();
    direction = solved + next / power * direction;
    power = next;
  }
  return x->allFinite() ? Status::kOk : Status::kDegenerate;
}

bool AllFinite(const std::vector<std::vector<OffsetPull>>& pulls, const std::vector<Eigen::VectorXd>& values) {
  for (size_t i = 0; i < pulls.size(); ++i) {
    for (const OffsetPull& pull : pulls[i]) {
      if (!std::isfinite(pull.gap_px * pull.weight) || !pull.direction.allFinite() || !values[i].allFinite()) return false;
    }
  }
  return true;
}

}  // namespace

Sparse StiffnessMatrix(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces, const OffsetStiffness& stiffness) {
  const Sparse laplacian = UmbrellaLaplacian(vertices, faces);
  Sparse matrix = std::pow(stiffness.laplacian_sigma_m, -2) * Sparse(laplacian.transpose() * laplacian);
  matrix += std::pow(stiffness.strain_sigma, -2) * StrainMatrix(vertices, faces);
  Sparse identity(vertices.cols(), vertices.cols());
  identity.setIdentity();
  matrix += std::pow(stiffness.offset_sigma_m, -2) * identity;
  return matrix;
}

Eigen::Matrix3Xf OffsetsAt(const Eigen::MatrixXd& weights, const Eigen::VectorXd& values) {
  MVS_CHECK(weights.cols() == 3 * values.size(), weights.cols() << " columns for " << values.size() << " values");
  Eigen::Matrix3Xf offsets(3, weights.rows());
  for (Eigen::Index v = 0; v < weights.rows(); ++v)
    offsets.col(v) = OffsetOf(weights, static_cast<int>(v), values).cast<float>();
  return offsets;
}

Status StepWeights(const Sparse& stiffness, const std::vector<std::vector<OffsetPull>>& pulls,
                   const std::vector<Eigen::VectorXd>& values, Eigen::MatrixXd* weights) {
  MVS_CHECK(pulls.size() == values.size() && weights->rows() == stiffness.cols(),
            pulls.size() << " time steps of " << values.size() << ", " << weights->rows() << " vertices");
  if (!AllFinite(pulls, values) || !weights->allFinite()) return Status::kNonFiniteInput;
  Pulls problem(pulls, values, weights->rows());
  const Eigen::MatrixXd at_rest = stiffness * *weights;
  Eigen::MatrixXd step = Eigen::MatrixXd::Zero(weights->rows(), weights->cols());
  for (int k = 0; k < kReweightings; ++k) {
    problem.Reweight(step);
    const Status status = ConjugateGradients(stiffness, problem, problem.Force() - at_rest, &step);
    if (status != Status::kOk) return status;
  }
  *weights += step;
  return Status::kOk;
}

void LimitOffsets(const std::vector<Eigen::VectorXd>& values, double most_m, Eigen::MatrixXd* weights) {
  for (Eigen::Index v = 0; v < weights->rows(); ++v) {
    double most = 0;
    for (const Eigen::VectorXd& value : values) most = std::max(most, OffsetOf(*weights, static_cast<int>(v), value).norm());
    if (most > most_m) weights->row(v) *= most_m / most;
  }
}

Eigen::Matrix3Xf LinearOffsets::At(const ArticulatedPose& pose) const { return OffsetsAt(weights, basis.Values(pose)); }

void AddLinearOffsets(const LinearOffsets& offsets, BodyTemplate* body) {
  const TurnBasis& basis = offsets.basis;
  const Eigen::Index count = body->vertices.cols(), size = basis.mean.size();
  MVS_CHECK(offsets.weights.rows() == count && offsets.weights.cols() == 3 * basis.size(),
            offsets.weights.rows() << " x " << offsets.weights.cols() << " weights for " << count << " vertices");
  if (body->pose_directions.size() == 0) body->pose_directions = Eigen::MatrixXf::Zero(3 * count, size);
  Eigen::MatrixXd columns(3 * count, basis.size());  // of a value each
  for (Eigen::Index k = 0; k < basis.size(); ++k) columns.col(k) = offsets.weights.middleCols<3>(3 * k).transpose().reshaped();
  body->pose_directions += (columns * basis.to_unit).cast<float>();
  body->vertices.reshaped() -= (columns * (basis.to_unit * basis.mean)).cast<float>();
}

}  // namespace mvstudio::body
