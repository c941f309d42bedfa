#include "avatar/body/texture/max_flow.h"

#include <algorithm>
#include <cstdlib>

#include "core/check.h"

namespace mvstudio::body {

MaxFlow::MaxFlow(int num_nodes)
    : leave_(static_cast<size_t>(num_nodes)), terminal_(static_cast<size_t>(num_nodes), 0), level_(leave_.size(), -1) {}

void MaxFlow::AddTerminal(int node, int64_t from_source, int64_t to_sink) {
  MVS_CHECK(from_source >= 0 && to_sink >= 0, "capacities " << from_source << " and " << to_sink);
  int64_t& rest = terminal_.at(static_cast<size_t>(node));
  const int64_t source = from_source + std::max<int64_t>(rest, 0), sink = to_sink + std::max<int64_t>(-rest, 0);
  flow_ += std::min(source, sink);  // straight through the node
  rest = source - sink;
}

void MaxFlow::AddEdge(int a, int b, int64_t forward, int64_t backward) {
  MVS_CHECK(forward >= 0 && backward >= 0 && a != b, "capacities " << forward << " and " << backward);
  leave_.at(static_cast<size_t>(a)).push_back(static_cast<int>(edges_.size()));
  leave_.at(static_cast<size_t>(b)).push_back(static_cast<int>(edges_.size()) + 1);
  edges_.push_back({b, forward});
  edges_.push_back({a, backward});
}

bool MaxFlow::FindLevels() {
  std::fill(level_.begin(), level_.end(), -1);
  std::vector<int> queue;
  for (size_t v = 0; v < terminal_.size(); ++v) {
    if (terminal_[v] > 0) level_[v] = 0, queue.push_back(static_cast<int>(v));
  }
  bool reached = false;
  for (size_t head = 0; head < queue.size(); ++head) {
    const auto v = static_cast<size_t>(queue[head]);
    reached = reached || terminal_[v] < 0;
    for (const int e : leave_[v]) {
      const Edge& edge = edges_[static_cast<size_t>(e)];
      int& level = level_[static_cast<size_t>(edge.to)];
      if (edge.rest <= 0 || level >= 0) continue;
      level = level_[v] + 1;
      queue.push_back(edge.to);
    }
  }
  return reached;
}

bool MaxFlow::Advance(int node) {
  const auto v = static_cast<size_t>(node);
  for (size_t& at = next_[v]; at < leave_[v].size(); ++at) {
    const int e = leave_[v][at];
    const Edge& edge = edges_[static_cast<size_t>(e)];
    if (edge.rest <= 0 || level_[static_cast<size_t>(edge.to)] != level_[v] + 1) continue;
    path_.push_back(e);
    return true;
  }
  return false;
}

bool MaxFlow::Augment(int start) {
  path_.clear();
  int at = start;
  while (terminal_[static_cast<size_t>(at)] >= 0) {
    if (Advance(at)) {
      at = edges_[static_cast<size_t>(path_.back())].to;
      continue;
    }
    if (path_.empty()) return false;
    at = edges_[static_cast<size_t>(path_.back() ^ 1)].to;  // back, and on by the next edge
    path_.pop_back();
    ++next_[static_cast<size_t>(at)];
  }
  int64_t amount = std::min(terminal_[static_cast<size_t>(start)], -terminal_[static_cast<size_t>(at)]);
  for (const int e : path_) amount = std::min(amount, edges_[static_cast<size_t>(e)].rest);
  for (const int e : path_) edges_[static_cast<size_t>(e)].rest -= amount, edges_[static_cast<size_t>(e ^ 1)].rest += amount;
  terminal_[static_cast<size_t>(start)] -= amount, terminal_[static_cast<size_t>(at)] += amount;
  flow_ += amount;
  return true;
}

int64_t MaxFlow::Solve() {
  while (FindLevels()) {
    next_.assign(leave_.size(), 0);
    for (size_t v = 0; v < terminal_.size(); ++v) {
      while (terminal_[v] > 0 && Augment(static_cast<int>(v))) {
      }
    }
  }
  return flow_;
}

}  // namespace mvstudio::body
