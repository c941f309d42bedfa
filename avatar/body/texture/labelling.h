#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace mvstudio::body {

/// A label for each of N nodes: the sum over the nodes of `data` and over the edges of `pair` is to be small.
struct LabelProblem {
  struct Edge {
    int a = 0, b = 0;
  };
  int num_nodes = 0, num_labels = 0;
  std::vector<Edge> edges;
  std::function<int64_t(int node, int label)> data;
  /// A metric in the labels: 0 for equal ones, symmetric, and never more than over a third label.
  std::function<int64_t(size_t edge, int label_a, int label_b)> pair;
};

/// Cost of a label that a node cannot have. Sums of a million nodes fit into 63 bits.
inline constexpr int64_t kForbiddenLabel = int64_t{1} << 40;

int64_t EnergyOf(const LabelProblem& problem, const std::vector<int>& labels);

/// Moves in which any nodes change to one label, each the best of its kind by a minimum cut, over all labels until none lowers
/// the energy or `max_sweeps` are done: what is left is within twice the optimum for pairs of one cost (Boykov, Veksler, Zabih,
/// "Fast Approximate Energy Minimization via Graph Cuts", PAMI 2001; the graph is that of Kolmogorov, Zabih, "What Energy
/// Functions Can Be Minimized via Graph Cuts?", PAMI 2004). Two labels give the optimum.
std::vector<int> ExpandLabels(const LabelProblem& problem, std::vector<int> labels, int max_sweeps);

}  // namespace mvstudio::body
