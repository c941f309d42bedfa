#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace mvstudio::geometry {

/// Cholesky factor of a symmetric positive definite matrix whose rows come in small blocks ("nodes"), by dense fronts
/// (Duff and Reid, 1983) in an order of the caller's. An order that follows a chain in time makes cost and memory linear in
/// its length, whatever few nodes are coupled with all others: those go last.
class BlockCholesky {
 public:
  /// Where a block of the matrix is stored, column by column.
  struct Place {
    Eigen::Index first = 0, stride = 0;
  };

  /// `widths`: (nodes) rows of each, at most 3. `groups`: nodes that are eliminated together, first to last, every node in one
  /// of them. `couplings`: pairs of nodes whose block is not zero; diagonal blocks are there without.
  BlockCholesky(std::vector<int> widths, const std::vector<std::vector<int>>& groups,
                const std::vector<std::pair<int, int>>& couplings);

  /// The block of two coupled nodes, or of one with itself. Its rows are those of the node eliminated later; of a diagonal
  /// block only the lower triangle counts.
  Place Find(int node_a, int node_b) const;
  double* At(const Place& place) { return values_.data() + place.first; }

  /// All entries 0, before the blocks are summed again.
  void SetZero() { values_.setZero(); }
  /// Replaces the matrix by its factor. False when it is not positive definite or not finite.
  bool Factor();
  /// After Factor; `right`: (rows), nodes in the caller's order.
  Eigen::VectorXd Solve(Eigen::VectorXd right) const;
  /// After Factor: the diagonal blocks of the inverse, (nodes), each in the upper left corner (Erisman and Tinney, 1975).
  std::vector<Eigen::Matrix3d> InverseDiagonal() const;
  Eigen::Index num_rows() const { return first_row_.back(); }

 private:
  /// Nodes eliminated together and the later ones that these are coupled with, fill included. Its panel is stored in
  /// values_: (own + below rows, own columns).
  struct Front {
    std::vector<int> own, below;  // nodes, in the order of elimination
    Eigen::Index num_own = 0, num_below = 0, first_value = 0;
    int parent = -1;
    std::vector<int> children;
    std::vector<Eigen::Index> in_parent;  // (below rows) row in the parent's front
  };
  using Panel = Eigen::Map<Eigen::MatrixXd>;
  using ConstPanel = Eigen::Map<const Eigen::MatrixXd>;

  Panel PanelOf(const Front& f) { return {values_.data() + f.first_value, f.num_own + f.num_below, f.num_own}; }
  ConstPanel PanelOf(const Front& f) const { return {values_.data() + f.first_value, f.num_own + f.num_below, f.num_own}; }
  void FindFill(const std::vector<std::pair<int, int>>& couplings);
  void PlaceInParent(Front* front);
  Eigen::Index RowInFront(const Front& front, int node) const;
  bool FactorFront(const Front& front, Eigen::MatrixXd* update);
  void AddChild(const Front& child, const Eigen::MatrixXd& update, Panel panel, Eigen::MatrixXd* sum) const;

  std::vector<int> widths_, rank_, front_of_;  // (nodes)
  std::vector<Eigen::Index> first_row_;        // (nodes + 1)
  std::vector<Front> fronts_;
  Eigen::VectorXd values_;
};

}  // namespace mvstudio::geometry
