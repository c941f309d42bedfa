#include "dataset/masks/cut.h"

#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>

namespace mvstudio::dataset::internal {
void SolveCut(CutProblem* problem) {
  CutProblem& p = *problem;
  const int n = p.width * p.height;
  std::vector<int> node(n, -1);
  int count = 0;
  for (int i = 0; i < n; ++i) count += p.label[i] == Label::kFree;
  if (count == 0) return;
  cv::detail::GCGraph<double> graph(count, 8 * count);
  std::vector<double> favour(n, 0);  // cost as background minus cost as person, decided neighbours included
  const auto add_costs = [&](int i, double as_background, double as_person) {
    graph.addTermWeights(node[i], as_background, as_person);
    favour[i] += as_background - as_person;
  };
  for (int i = 0; i < n; ++i) {
    if (p.label[i] != Label::kFree) continue;
    node[i] = graph.addVtx();
    add_costs(i, p.background_cost[i], p.person_cost[i]);
  }
  const double beta = 1.0 / (2.0 * p.mean_contrast2);
  bool connected = false;
  const auto connect = [&](int i, int j, float contrast2, double length) {
    const double weight = p.smoothness / length * std::exp(-beta * contrast2);
    if (node[i] >= 0 && node[j] >= 0) {
      graph.addEdges(node[i], node[j], weight, weight);
      connected = true;
    } else if (node[i] >= 0 || node[j] >= 0) {
      const int free = node[i] >= 0 ? i : j, fixed = node[i] >= 0 ? j : i;
      const bool person = p.label[fixed] == Label::kPerson;
      add_costs(free, person ? weight : 0, person ? 0 : weight);
    }
  };
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) {
      const int i = y * p.width + x;
      if (x + 1 < p.width) connect(i, i + 1, p.contrast2_x[i], 1.0);
      if (y + 1 < p.height) connect(i, i + p.width, p.contrast2_y[i], 1.0);
      if (x + 1 < p.width && y + 1 < p.height) connect(i, i + p.width + 1, p.contrast2_d[i], M_SQRT2);
      if (x > 0 && y + 1 < p.height) connect(i, i + p.width - 1, p.contrast2_u[i], M_SQRT2);
    }
  }
  if (!connected) {  // the solver refuses a graph without edges; pixels decide alone
    for (int i = 0; i < n; ++i) {
      if (node[i] >= 0) p.label[i] = favour[i] > 0 ? Label::kPerson : Label::kBackground;
    }
    return;
  }
  graph.maxFlow();
  for (int i = 0; i < n; ++i) {
    if (node[i] >= 0) p.label[i] = graph.inSourceSegment(node[i]) ? Label::kPerson : Label::kBackground;
  }
}

}  // namespace mvstudio::dataset::internal
