#include "avatar/body/dynamic/turn_basis.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace mvstudio::body {
namespace {

// Of a component's standard deviation, in entries of rotations (about radians).
constexpr double kLeastTurn = 0.05, kSmallTurn = 0.2;

}  // namespace

Eigen::VectorXd TurnsOf(const ArticulatedPose& pose) {
  Eigen::VectorXd turns(9 * (static_cast<Eigen::Index>(pose.local_rotations.size()) - 1));
  for (size_t b = 1; b < pose.local_rotations.size(); ++b) {
    const Eigen::Matrix3d turn = pose.local_rotations[b].toRotationMatrix() - Eigen::Matrix3d::Identity();
    turns.segment<9>(9 * static_cast<Eigen::Index>(b - 1)) = turn.reshaped<Eigen::RowMajor>();
  }
  return turns;
}

Eigen::VectorXd TurnBasis::Values(const ArticulatedPose& pose) const { return to_unit * (TurnsOf(pose) - mean); }

TurnBasis FindTurnBasis(const std::vector<ArticulatedPose>& poses, int most) {
  TurnBasis basis;
  if (poses.size() < 2) return basis;
  Eigen::MatrixXd turns(9 * (static_cast<Eigen::Index>(poses[0].local_rotations.size()) - 1),
                        static_cast<Eigen::Index>(poses.size()));
  for (size_t i = 0; i < poses.size(); ++i) turns.col(static_cast<Eigen::Index>(i)) = TurnsOf(poses[i]);
  basis.mean = turns.rowwise().mean();
  turns.colwise() -= basis.mean;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> components(turns * turns.transpose() /
                                                                  static_cast<double>(poses.size() - 1));
  const Eigen::Index size = turns.rows();
  Eigen::Index count = 0;
  const auto deviation = [&](Eigen::Index i) { return std::sqrt(std::max(0.0, components.eigenvalues()[size - 1 - i])); };
  while (count < std::min<Eigen::Index>(most, size) && deviation(count) >= kLeastTurn) ++count;
  basis.to_unit.resize(count, size);
  for (Eigen::Index i = 0; i < count; ++i)
    basis.to_unit.row(i) = components.eigenvectors().col(size - 1 - i).transpose() / std::max(deviation(i), kSmallTurn);
  return basis;
}

}  // namespace mvstudio::body
