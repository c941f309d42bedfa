#include "geometry/solve/block_cholesky.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "core/check.h"

namespace mvstudio::geometry {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

BlockCholesky::BlockCholesky(std::vector<int> widths, const std::vector<std::vector<int>>& groups,
                             const std::vector<std::pair<int, int>>& couplings)
    : widths_(std::move(widths)), rank_(widths_.size(), -1), front_of_(widths_.size(), -1), first_row_{0} {
  for (const int width : widths_) {
    MVS_CHECK(width >= 1 && width <= 3, "a node of " << width << " rows");
    first_row_.push_back(first_row_.back() + width);
  }
  int rank = 0;
  for (const std::vector<int>& group : groups) {
    if (group.empty()) continue;
    for (const int node : group) {
      int& mine = rank_.at(static_cast<size_t>(node));
      MVS_CHECK(mine < 0, "node " << node << " is in two groups");
      mine = rank++, front_of_[static_cast<size_t>(node)] = static_cast<int>(fronts_.size());
    }
    fronts_.emplace_back().own = group;
  }
  MVS_CHECK(static_cast<size_t>(rank) == widths_.size(), rank << " of " << widths_.size() << " nodes are in groups");
  FindFill(couplings);
}

void BlockCholesky::FindFill(const std::vector<std::pair<int, int>>& couplings) {
  const auto earlier = [this](int a, int b) { return rank_[static_cast<size_t>(a)] < rank_[static_cast<size_t>(b)]; };
  for (const auto& [a, b] : couplings) {
    const int first = front_of_.at(static_cast<size_t>(a)), second = front_of_.at(static_cast<size_t>(b));
    if (first != second) fronts_[static_cast<size_t>(std::min(first, second))].below.push_back(first < second ? b : a);
  }
  Index num_values = 0;
  for (size_t k = 0; k < fronts_.size(); ++k) {
    Front& front = fronts_[k];
    for (const int child : front.children) {
      for (const int node : fronts_[static_cast<size_t>(child)].below) {
        if (front_of_[static_cast<size_t>(node)] != static_cast<int>(k)) front.below.push_back(node);
      }
    }
    std::sort(front.below.begin(), front.below.end(), earlier);
    front.below.erase(std::unique(front.below.begin(), front.below.end()), front.below.end());
    for (const int node : front.own) front.num_own += widths_[static_cast<size_t>(node)];
    for (const int node : front.below) front.num_below += widths_[static_cast<size_t>(node)];
    front.first_value = num_values;
    num_values += (front.num_own + front.num_below) * front.num_own;
    if (front.below.empty()) continue;
    front.parent = front_of_[static_cast<size_t>(front.below.front())];
    fronts_[static_cast<size_t>(front.parent)].children.push_back(static_cast<int>(k));
  }
  for (Front& front : fronts_) PlaceInParent(&front);
  values_ = VectorXd::Zero(num_values);
}

void BlockCholesky::PlaceInParent(Front* front) {
  if (front->parent < 0) return;
  for (const int node : front->below) {
    const Index first = RowInFront(fronts_[static_cast<size_t>(front->parent)], node);
    for (int k = 0; k < widths_[static_cast<size_t>(node)]; ++k) front->in_parent.push_back(first + k);
  }
}

Index BlockCholesky::RowInFront(const Front& front, int node) const {
  Index row = 0;
  for (const std::vector<int>* nodes : {&front.own, &front.below}) {
    for (const int each : *nodes) {
      if (each == node) return row;
      row += widths_[static_cast<size_t>(each)];
    }
  }
  MVS_CHECK(false, "node " << node << " is not coupled with this front");
  return -1;
}

BlockCholesky::Place BlockCholesky::Find(int node_a, int node_b) const {
  if (rank_.at(static_cast<size_t>(node_a)) > rank_.at(static_cast<size_t>(node_b))) std::swap(node_a, node_b);
  const Front& front = fronts_[static_cast<size_t>(front_of_[static_cast<size_t>(node_a)])];
  const Index stride = front.num_own + front.num_below;
  return {front.first_value + RowInFront(front, node_a) * stride + RowInFront(front, node_b), stride};
}

/// Rows ascend in both fronts, so lower triangles stay lower.
void BlockCholesky::AddChild(const Front& child, const MatrixXd& update, Panel panel, MatrixXd* sum) const {
  const Index num_own = panel.cols();
  for (Index col = 0; col < update.cols(); ++col) {
    const Index to = child.in_parent[static_cast<size_t>(col)];
    double* column = to < num_own ? &panel(0, to) : sum->data() + (to - num_own) * sum->rows() - num_own;
    for (Index row = col; row < update.rows(); ++row) column[child.in_parent[static_cast<size_t>(row)]] += update(row, col);
  }
}

bool BlockCholesky::FactorFront(const Front& front, MatrixXd* update) {
  Panel panel = PanelOf(front);
  Eigen::Ref<MatrixXd> own = panel.topRows(front.num_own);
  const Eigen::LLT<Eigen::Ref<MatrixXd>> factor(own);
  if (factor.info() != Eigen::Success || !own.diagonal().allFinite()) return false;
  if (front.num_below == 0) return true;
  Eigen::Ref<MatrixXd> below = panel.bottomRows(front.num_below);
  own.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(below);
  update->selfadjointView<Eigen::Lower>().rankUpdate(below, -1);
  return true;
}

bool BlockCholesky::Factor() {
  std::vector<MatrixXd> updates(fronts_.size());
  for (size_t k = 0; k < fronts_.size(); ++k) {
    const Front& front = fronts_[k];
    updates[k] = MatrixXd::Zero(front.num_below, front.num_below);
    for (const int child : front.children) {
      AddChild(fronts_[static_cast<size_t>(child)], updates[static_cast<size_t>(child)], PanelOf(front), &updates[k]);
      updates[static_cast<size_t>(child)].resize(0, 0);
    }
    if (!FactorFront(front, &updates[k])) return false;
  }
  return true;
}

VectorXd BlockCholesky::Solve(VectorXd x) const {
  MVS_CHECK(x.size() == num_rows(), x.size() << " values for " << num_rows() << " rows");
  const auto gather = [&](const std::vector<int>& nodes, Index size) {
    VectorXd part(size);
    Index row = 0;
    for (const int node : nodes) {
      const Index first = first_row_[static_cast<size_t>(node)];
      for (int k = 0; k < widths_[static_cast<size_t>(node)]; ++k) part[row++] = x[first + k];
    }
    return part;
  };
  const auto scatter = [&](const std::vector<int>& nodes, const VectorXd& part) {
    Index row = 0;
    for (const int node : nodes) {
      const Index first = first_row_[static_cast<size_t>(node)];
      for (int k = 0; k < widths_[static_cast<size_t>(node)]; ++k) x[first + k] = part[row++];
    }
  };
  for (const Front& front : fronts_) {
    const ConstPanel panel = PanelOf(front);
    VectorXd own = gather(front.own, front.num_own);
    panel.topRows(front.num_own).triangularView<Eigen::Lower>().solveInPlace(own);
    scatter(front.own, own);
    scatter(front.below, gather(front.below, front.num_below) - panel.bottomRows(front.num_below) * own);
  }
  for (auto front = fronts_.rbegin(); front != fronts_.rend(); ++front) {
    const ConstPanel panel = PanelOf(*front);
    VectorXd own = gather(front->own, front->num_own);
    own.noalias() -= panel.bottomRows(front->num_below).transpose() * gather(front->below, front->num_below);
    panel.topRows(front->num_own).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
    scatter(front->own, own);
  }
  return x;
}

/// With the factor's panel (L; B), G = B L^-1 and Z the inverse: Z_below,own = -Z_below G, Z_own = (L L^T)^-1 - G^T
/// Z_below,own.
std::vector<Eigen::Matrix3d> BlockCholesky::InverseDiagonal() const {
  std::vector<Eigen::Matrix3d> blocks(widths_.size(), Eigen::Matrix3d::Zero());
  std::vector<MatrixXd> inverses(fronts_.size());  // of whole fronts, while children need them
  for (size_t k = fronts_.size(); k-- > 0;) {
    const Front& front = fronts_[k];
    const ConstPanel panel = PanelOf(front);
    const Index n = front.num_own, r = front.num_below;
    MatrixXd& whole = inverses[k];
    whole.resize(n + r, n + r);
    MatrixXd factor_inverse = MatrixXd::Identity(n, n);
    panel.topRows(n).triangularView<Eigen::Lower>().solveInPlace(factor_inverse);
    whole.topLeftCorner(n, n).noalias() = factor_inverse.transpose() * factor_inverse;
    if (r > 0) {
      const MatrixXd& parent = inverses[static_cast<size_t>(front.parent)];
      for (Index col = 0; col < r; ++col) {
        const double* from = &parent(0, front.in_parent[static_cast<size_t>(col)]);
        for (Index row = 0; row < r; ++row) whole(n + row, n + col) = from[front.in_parent[static_cast<size_t>(row)]];
      }
      const MatrixXd g = panel.bottomRows(r) * factor_inverse;
      whole.bottomLeftCorner(r, n).noalias() = -whole.bottomRightCorner(r, r) * g;
      whole.topLeftCorner(n, n).noalias() -= g.transpose() * whole.bottomLeftCorner(r, n);
      whole.topRightCorner(n, r) = whole.bottomLeftCorner(r, n).transpose();
      if (fronts_[static_cast<size_t>(front.parent)].children.front() == static_cast<int>(k)) {
        inverses[static_cast<size_t>(front.parent)].resize(0, 0);  // children come last to first
      }
    }
    Index row = 0;
    for (const int node : front.own) {
      const int width = widths_[static_cast<size_t>(node)];
      blocks[static_cast<size_t>(node)].topLeftCorner(width, width) = whole.block(row, row, width, width);
      row += width;
    }
    if (front.children.empty()) whole.resize(0, 0);
  }
  return blocks;
}

}  // namespace mvstudio::geometry
