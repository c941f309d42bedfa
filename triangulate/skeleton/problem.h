// Private: the equations of RefineSkeleton's solver.
#pragma once

#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "geometry/solve/block_cholesky.h"
#include "triangulate/skeleton/window.h"

/// The unknowns of a window and the residuals between them. Nodes of the normal equations: the positions, 3 rows each, and
/// after them the lengths of bones, 1 row each.
namespace mvstudio::triangulate::internal {

constexpr double kRobustSigmas = 2;  ///< of detections
constexpr double kTermSigmas = 3;    ///< of accelerations and lengths

/// Cauchy loss of a whitened squared residual, and its weight.
double Loss(double squared, double sigmas);
double Weight(double squared, double sigmas);

struct Seen {
  size_t cell, observation;
};

/// Three positions of a joint whose acceleration is sum c_k x_k, in units of its sigma.
struct Triple {
  size_t cell[3];
  double c[3];
};

struct Bone {
  size_t bone, cell_a, cell_b;
};

struct SkeletonProblem {
  const PreparedRig* rig;
  const Window* window;
  const Terms* terms;
  const std::vector<KnownLength>* known;
  std::vector<int> variable = {};  // (cells) node of the position, or -1
  int num_positions = 0;
  std::vector<Seen> seen = {};
  std::vector<Triple> triples = {};
  std::vector<Bone> bones = {};
  std::vector<int> length_node = {};  // (bones) node of the length, or -1
  int num_lengths = 0;

  Eigen::Index size() const { return 3 * num_positions + num_lengths; }
  Eigen::Index LengthRow(size_t bone) const { return 2 * num_positions + length_node[bone]; }
};

struct Unknowns {
  std::vector<Eigen::Vector3d> x_in_local;  // (cells)
  std::vector<double> length_m;             // (bones)
};

bool IsOk(const Window& window, size_t f, size_t j);

/// Nearest frame, from f in steps of `step`, where the joint is known, at most max_frames away.
std::optional<size_t> NearestOk(const Window& window, size_t f, size_t j, int step, int max_frames);

/// Known joints start where they are, bridged ones on the line between their neighbours in time.
SkeletonProblem MakeProblem(const PreparedRig& rig, const Window& window, const Bones& bones,
                            const std::vector<KnownLength>& known, const Terms& terms, Unknowns* start);

/// Nodes in the order of their elimination. Joints that no bone joins are independent. Time is cut into blocks by pairs of
/// frames, which separate them because an acceleration spans three; inside a block joints go from the limbs' ends inwards,
/// a pair of frames after the blocks on both sides, lengths last. Cost and memory so grow with the frames.
std::vector<std::vector<int>> EliminationGroups(const SkeletonProblem& problem);

/// The normal equations of the reweighted problem.
class Equations {
 public:
  explicit Equations(const SkeletonProblem& problem);
  /// Robust cost; infinite where a detection that is not robust cannot be projected.
  double Cost(const Unknowns& at) { return Sum(at, false); }
  /// The same, and matrix and gradient.
  double Linearize(const Unknowns& at) { return Sum(at, true); }
  /// After Linearize: the step to the minimum. Empty when the matrix is singular.
  std::optional<Eigen::VectorXd> Step();
  /// After Step: the diagonal blocks of the inverse, (nodes).
  std::vector<Eigen::Matrix3d> InverseDiagonal() const { return matrix_.InverseDiagonal(); }

 private:
  using Place = geometry::BlockCholesky::Place;

  bool AddDetections(const Unknowns& at, bool want_matrix, double* cost);
  void AddAccelerations(const Unknowns& at, bool want_matrix, double* cost);
  void AddBones(const Unknowns& at, bool want_matrix, double* cost);
  double Sum(const Unknowns& at, bool want_matrix);
  auto BlockAt(const Place& place) {
    return Eigen::Map<Eigen::Matrix3d, 0, Eigen::OuterStride<>>(matrix_.At(place), Eigen::OuterStride<>(place.stride));
  }
  auto RowAt(const Place& place) {  // of a length
    return Eigen::Map<Eigen::Vector3d, 0, Eigen::InnerStride<>>(matrix_.At(place), Eigen::InnerStride<>(place.stride));
  }

  const SkeletonProblem& problem_;
  geometry::BlockCholesky matrix_;
  Eigen::VectorXd gradient_;
  std::vector<Place> diagonal_;                // (nodes)
  std::vector<std::array<Place, 3>> triples_;  // (triples) 1-0, 2-0, 2-1
  std::vector<std::array<Place, 3>> bones_;    // (bones) of both positions, of each and the length
};

}  // namespace mvstudio::triangulate::internal
