#include "avatar/body/texture/labelling.h"

#include <algorithm>

#include "avatar/body/texture/max_flow.h"
#include "core/check.h"

namespace mvstudio::body {
namespace {

/// The best labels in which nodes keep theirs or take `alpha`. The sink's side takes it.
std::vector<int> Expansion(const LabelProblem& problem, const std::vector<int>& labels, int alpha) {
  MaxFlow graph(problem.num_nodes);
  std::vector<int64_t> gain(labels.size());  // cost of the new label minus that of the old one
  for (int v = 0; v < problem.num_nodes; ++v)
    gain[static_cast<size_t>(v)] = problem.data(v, alpha) - problem.data(v, labels[static_cast<size_t>(v)]);
  for (size_t e = 0; e < problem.edges.size(); ++e) {
    const auto [a, b] = problem.edges[e];
    const int la = labels[static_cast<size_t>(a)], lb = labels[static_cast<size_t>(b)];
    const int64_t keep = problem.pair(e, la, lb), only_b = problem.pair(e, la, alpha), only_a = problem.pair(e, alpha, lb);
    gain[static_cast<size_t>(a)] += only_a - keep;
    gain[static_cast<size_t>(b)] -= only_a;
    if (only_a + only_b > keep) graph.AddEdge(a, b, only_a + only_b - keep, 0);
  }
  for (int v = 0; v < problem.num_nodes; ++v) {
    const int64_t cost = gain[static_cast<size_t>(v)];
    graph.AddTerminal(v, std::max<int64_t>(cost, 0), std::max<int64_t>(-cost, 0));
  }
  graph.Solve();
  std::vector<int> out = labels;
  for (int v = 0; v < problem.num_nodes; ++v) {
    if (!graph.OnSourceSide(v)) out[static_cast<size_t>(v)] = alpha;
  }
  return out;
}

}  // namespace

int64_t EnergyOf(const LabelProblem& problem, const std::vector<int>& labels) {
  int64_t energy = 0;
  for (int v = 0; v < problem.num_nodes; ++v) energy += problem.data(v, labels[static_cast<size_t>(v)]);
  for (size_t e = 0; e < problem.edges.size(); ++e)
    energy += problem.pair(e, labels[static_cast<size_t>(problem.edges[e].a)], labels[static_cast<size_t>(problem.edges[e].b)]);
  return energy;
}

std::vector<int> ExpandLabels(const LabelProblem& problem, std::vector<int> labels, int max_sweeps) {
  MVS_CHECK(labels.size() == static_cast<size_t>(problem.num_nodes), labels.size() << " labels");
  int64_t energy = EnergyOf(problem, labels);
  bool changed = true;
  for (int sweep = 0; sweep < max_sweeps && changed; ++sweep) {
    changed = false;
    for (int alpha = 0; alpha < problem.num_labels; ++alpha) {
      std::vector<int> expanded = Expansion(problem, labels, alpha);
      const int64_t lower = EnergyOf(problem, expanded);
      if (lower >= energy) continue;
      energy = lower, labels = std::move(expanded), changed = true;
    }
  }
  return labels;
}

}  // namespace mvstudio::body
