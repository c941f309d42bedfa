#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace mvstudio::body {

/// Maximum flow from a source to a sink and the minimum cut between them, by blocking flows along shortest paths (Dinic, 1970).
/// Capacities are whole numbers, so the result is exact; they must not be negative, and their sum fits into 63 bits.
class MaxFlow {
 public:
  explicit MaxFlow(int num_nodes);

  void AddTerminal(int node, int64_t from_source, int64_t to_sink);
  /// Capacities a -> b and b -> a.
  void AddEdge(int a, int b, int64_t forward, int64_t backward);

  /// The flow. To be called once.
  int64_t Solve();
  /// Of the minimum cut with fewest nodes at the source; after Solve().
  bool OnSourceSide(int node) const { return level_[static_cast<size_t>(node)] >= 0; }

 private:
  struct Edge {
    int to;
    int64_t rest;
  };
  /// Shortest distances from the source over edges that are not full; whether the sink is among what is reached.
  bool FindLevels();
  /// One more path from a node that the source feeds; false: none is left.
  bool Augment(int start);
  bool Advance(int node);

  std::vector<Edge> edges_;              // 2i and 2i + 1 are the two directions of one edge
  std::vector<std::vector<int>> leave_;  // (N) edges that leave a node
  std::vector<int64_t> terminal_;        // (N) rest from the source; negative: rest to the sink
  std::vector<int> level_, path_;
  std::vector<size_t> next_;  // (N) first edge that may still carry something
  int64_t flow_ = 0;
};

}  // namespace mvstudio::body
