#include <algorithm>

#include "avatar/body/texture/labelling.h"
#include "avatar/body/texture/max_flow.h"
#include "avatar/body/texture/weighted_median.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

struct Arc {
  int a, b;
  int64_t forward, backward;
};

struct Network {
  std::vector<std::pair<int64_t, int64_t>> terminals;
  std::vector<Arc> arcs;
};

Network RandomNetwork(Rng* rng, int nodes, int arcs) {
  Network network;
  for (int v = 0; v < nodes; ++v) network.terminals.emplace_back(rng->Index(10), rng->Index(10));
  for (int k = 0; k < arcs; ++k) {
    const int a = static_cast<int>(rng->Index(nodes)), b = static_cast<int>(rng->Index(nodes));
    if (a != b) network.arcs.push_back({a, b, rng->Index(12), rng->Index(12)});
  }
  return network;
}

/// Bit v of `sides`: node v is on the sink's side.
int64_t CutOf(const Network& network, unsigned sides) {
  const auto sink = [&](int v) { return (sides >> v & 1u) != 0; };
  int64_t cut = 0;
  for (size_t v = 0; v < network.terminals.size(); ++v)
    cut += sink(static_cast<int>(v)) ? network.terminals[v].first : network.terminals[v].second;
  for (const Arc& arc : network.arcs)
    cut += !sink(arc.a) && sink(arc.b) ? arc.forward : sink(arc.a) && !sink(arc.b) ? arc.backward : 0;
  return cut;
}

TEST(MaxFlow, EqualsTheLeastOfAllCuts) {
  Rng rng(7);
  for (int trial = 0; trial < 300; ++trial) {
    const int nodes = 1 + static_cast<int>(rng.Index(9));
    const Network network = RandomNetwork(&rng, nodes, 3 * nodes);
    MaxFlow graph(nodes);
    for (int v = 0; v < nodes; ++v) graph.AddTerminal(v, network.terminals[v].first, network.terminals[v].second);
    for (const Arc& arc : network.arcs) graph.AddEdge(arc.a, arc.b, arc.forward, arc.backward);
    const int64_t flow = graph.Solve();
    int64_t least = CutOf(network, 0);
    for (unsigned sides = 1; sides < 1u << nodes; ++sides) least = std::min(least, CutOf(network, sides));
    EXPECT_EQ(flow, least) << "trial " << trial;
    unsigned found = 0;
    for (int v = 0; v < nodes; ++v) found |= graph.OnSourceSide(v) ? 0u : 1u << v;
    EXPECT_EQ(CutOf(network, found), least) << "trial " << trial;
  }
}

TEST(MaxFlow, CapacitiesOfATerminalAddUp) {
  MaxFlow graph(2);
  graph.AddTerminal(0, 5, 0);
  graph.AddTerminal(0, 4, 3);
  graph.AddTerminal(1, 0, 100);
  graph.AddEdge(0, 1, 4, 0);
  EXPECT_EQ(graph.Solve(), 7) << "3 through node 0, 4 over the edge";
  EXPECT_TRUE(graph.OnSourceSide(0));
  EXPECT_FALSE(graph.OnSourceSide(1));
}

TEST(MaxFlow, NoNodesCarryNothing) { EXPECT_EQ(MaxFlow(0).Solve(), 0); }

/// Nodes and labels on a line, random costs; pairs cost a weight times a truncated distance.
struct Problem {
  LabelProblem problem;
  std::vector<int64_t> data, weight, place;
};

void Fill(Rng* rng, int nodes, int labels, Problem* p) {
  p->problem.num_nodes = nodes, p->problem.num_labels = labels;
  for (int k = 0; k < nodes * labels; ++k) p->data.push_back(rng->Index(30));
  for (int k = 0; k < labels; ++k) p->place.push_back(rng->Index(8));
  for (int k = 0; k < 2 * nodes; ++k) {
    const int a = static_cast<int>(rng->Index(nodes)), b = static_cast<int>(rng->Index(nodes));
    if (a == b) continue;
    p->problem.edges.push_back({a, b});
    p->weight.push_back(rng->Index(5));
  }
  p->problem.data = [p, labels](int node, int label) { return p->data[static_cast<size_t>(node * labels + label)]; };
  p->problem.pair = [p](size_t edge, int a, int b) -> int64_t {
    return a == b ? 0 : p->weight[edge] * (2 + std::abs(p->place[static_cast<size_t>(a)] - p->place[static_cast<size_t>(b)]));
  };
}

int64_t LeastEnergy(const LabelProblem& problem) {
  std::vector<int> labels(static_cast<size_t>(problem.num_nodes), 0);
  int64_t least = EnergyOf(problem, labels);
  while (true) {
    size_t at = 0;
    while (at < labels.size() && ++labels[at] == problem.num_labels) labels[at++] = 0;
    if (at == labels.size()) return least;
    least = std::min(least, EnergyOf(problem, labels));
  }
}

std::vector<int> BestAlone(const LabelProblem& problem) {
  std::vector<int> labels(static_cast<size_t>(problem.num_nodes), 0);
  for (int v = 0; v < problem.num_nodes; ++v) {
    for (int l = 1; l < problem.num_labels; ++l)
      if (problem.data(v, l) < problem.data(v, labels[static_cast<size_t>(v)])) labels[static_cast<size_t>(v)] = l;
  }
  return labels;
}

TEST(ExpandLabels, OfTwoLabelsTakesTheBestOfAllLabellings) {
  Rng rng(11);
  for (int trial = 0; trial < 100; ++trial) {
    Problem p;
    Fill(&rng, 9, 2, &p);
    EXPECT_EQ(EnergyOf(p.problem, ExpandLabels(p.problem, BestAlone(p.problem), 10)), LeastEnergy(p.problem)) << trial;
  }
}

TEST(ExpandLabels, NoMoveToOneLabelIsBetter) {
  Rng rng(12);
  int64_t found = 0, least = 0, alone = 0;
  for (int trial = 0; trial < 40; ++trial) {
    Problem p;
    Fill(&rng, 7, 4, &p);
    const std::vector<int> labels = ExpandLabels(p.problem, BestAlone(p.problem), 20);
    const int64_t energy = EnergyOf(p.problem, labels);
    found += energy, least += LeastEnergy(p.problem), alone += EnergyOf(p.problem, BestAlone(p.problem));
    for (int alpha = 0; alpha < 4; ++alpha) {
      for (unsigned who = 1; who < 1u << 7; ++who) {
        std::vector<int> moved = labels;
        for (int v = 0; v < 7; ++v)
          if (who >> v & 1u) moved[static_cast<size_t>(v)] = alpha;
        ASSERT_GE(EnergyOf(p.problem, moved), energy) << "trial " << trial << ", label " << alpha;
      }
    }
  }
  EXPECT_GE(found, least);
  EXPECT_LT(static_cast<double>(found - least), 0.05 * static_cast<double>(alone - least));
}

TEST(ExpandLabels, ForbiddenLabelsAreNotTaken) {
  LabelProblem problem;
  problem.num_nodes = 2, problem.num_labels = 2, problem.edges = {{0, 1}};
  problem.data = [](int node, int label) { return node == label ? 5 : kForbiddenLabel; };
  problem.pair = [](size_t, int a, int b) -> int64_t { return a == b ? 0 : 1000000; };
  EXPECT_EQ(ExpandLabels(problem, {0, 1}, 5), (std::vector<int>{0, 1}));
}

TEST(WeightedMedian, MinimisesTheWeightedDistances) {
  Rng rng(3);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<std::pair<double, double>> samples;
    for (int k = 0; k <= trial % 9; ++k)
      samples.emplace_back(static_cast<double>(rng.Index(20)), static_cast<double>(1 + rng.Index(4)));
    const auto cost = [&](double x) {
      double sum = 0;
      for (const auto& [value, weight] : samples) sum += weight * std::abs(value - x);
      return sum;
    };
    const double median = WeightedMedian(samples);
    for (const auto& sample : samples) EXPECT_LE(cost(median), cost(sample.first) + 1e-9);
  }
}

TEST(WeightedMedian, AtExtremes) {
  EXPECT_TRUE(std::isnan(WeightedMedian({})));
  EXPECT_EQ(WeightedMedian({{7, 1e-30}}), 7);
  EXPECT_EQ(WeightedMedian({{1, 1}, {3, 1}}), 2);
  EXPECT_EQ(WeightedMedian({{1, 1}, {2, 1}, {300, 1}}), 2);
  EXPECT_EQ(WeightedMedian({{1, 5}, {2, 1}, {300, 1}}), 1);
}

}  // namespace
}  // namespace mvstudio::body
