#include "avatar/body/texture/level_seams.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <map>
#include <utility>

#include "core/check.h"

namespace mvstudio::body {
namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

/// Adds weight (x_a - x_b)^2.
void AddDifference(int a, int b, double weight, Triplets* out) {
  out->emplace_back(a, a, weight), out->emplace_back(b, b, weight);
  out->emplace_back(a, b, -weight), out->emplace_back(b, a, -weight);
}

}  // namespace

Eigen::Vector3f SeamCorrections::At(int face, const Eigen::Vector3f& barycentric) const {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int k = 0; k < 3; ++k) {
    const int node = node_of_corner[static_cast<size_t>(face)][k];
    if (node >= 0) sum += barycentric[k] * levels.col(node);
  }
  return sum;
}

SeamCorrections LevelSeams(const BodyTemplate& body, const std::vector<int>& view_of_face,
                           const std::function<Eigen::Vector3f(int vertex, int view)>& colour) {
  constexpr double kSmooth = 10, kTowardsZero = 1e-3;
  MVS_CHECK(view_of_face.size() == static_cast<size_t>(body.faces.cols()), view_of_face.size() << " views of faces");
  SeamCorrections out;
  std::map<std::pair<int, int>, int> nodes;  // vertex, view
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    const int view = view_of_face[static_cast<size_t>(f)];
    out.node_of_corner.push_back({-1, -1, -1});
    for (int k = 0; k < 3 && view >= 0; ++k)
      out.node_of_corner.back()[k] = nodes.emplace(std::make_pair(body.faces(k, f), view), nodes.size()).first->second;
  }
  const auto count = static_cast<Eigen::Index>(nodes.size());
  out.levels = Eigen::MatrixXf::Zero(3, count);
  if (count == 0) return out;
  Triplets triplets;
  Eigen::MatrixX3d right = Eigen::MatrixX3d::Zero(count, 3);
  for (const auto& corner : out.node_of_corner) {
    for (int k = 0; k < 3 && corner[0] >= 0; ++k) AddDifference(corner[k], corner[(k + 1) % 3], kSmooth, &triplets);
  }
  for (int i = 0; i < count; ++i) triplets.emplace_back(i, i, kTowardsZero);
  for (auto one = nodes.begin(); one != nodes.end(); ++one) {
    for (auto other = std::next(one); other != nodes.end() && other->first.first == one->first.first; ++other) {
      const Eigen::Vector3d step =
          (colour(one->first.first, one->first.second) - colour(other->first.first, other->first.second)).cast<double>();
      if (!step.allFinite()) continue;
      AddDifference(one->second, other->second, 1, &triplets);
      right.row(one->second) -= step.transpose(), right.row(other->second) += step.transpose();
    }
  }
  Eigen::SparseMatrix<double> left(count, count);
  left.setFromTriplets(triplets.begin(), triplets.end());
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver(left);
  solver.setTolerance(1e-6);
  for (int c = 0; c < 3; ++c) out.levels.row(c) = solver.solve(right.col(c)).cast<float>().transpose();
  return out;
}

}  // namespace mvstudio::body
