#include "triangulate/people/cluster.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "triangulate/people/affinity.h"
#include "triangulate/people/assignment.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
using Sketch = std::vector<std::optional<SketchPoint>>;

Eigen::MatrixXd PairMatrix(const std::vector<Candidate>& candidates, double sigma_px, const AssociationOptions& options) {
  const int n = static_cast<int>(candidates.size());
  Eigen::MatrixXd evidence = Eigen::MatrixXd::Constant(n, n, -kInfinity);
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j) {
      evidence(i, j) = evidence(j, i) = PairEvidence(candidates[i], candidates[j], sigma_px, options);
    }
  }
  return evidence;
}

/// Greedy additive edge contraction: joins the two groups with the largest sum of weights between them as long as it is
/// positive. Pairs of one camera weigh minus infinity.
std::vector<int> Contract(Eigen::MatrixXd weight) {
  const int n = static_cast<int>(weight.rows());
  std::vector<int> group(n);
  for (int i = 0; i < n; ++i) group[i] = i, weight(i, i) = -kInfinity;
  for (;;) {
    Eigen::Index a = 0, b = 0;
    if (n == 0 || !(weight.maxCoeff(&a, &b) > 0)) return group;
    weight.row(a) += weight.row(b);
    weight.col(a) += weight.col(b);
    weight.row(b).setConstant(-kInfinity);
    weight.col(b).setConstant(-kInfinity);
    weight(a, a) = -kInfinity;
    std::replace(group.begin(), group.end(), static_cast<int>(b), static_cast<int>(a));
  }
}

/// Groups of candidates with the sums of their rays.
class Groups {
 public:
  Groups(const std::vector<Candidate>& candidates, std::vector<int> group, double sigma_px, const AssociationOptions& options,
         const Eigen::MatrixXd& pairs)
      : candidates_(candidates), group_(std::move(group)), sigma_px_(sigma_px), options_(options), pairs_(pairs) {
    const size_t n = candidates.size();
    // Twice as many as detections: however a camera's are assigned, one that fits nowhere finds a group of its own.
    sums_.resize(2 * n), members_.resize(2 * n);
    for (size_t i = 0; i < n; ++i) Put(i, group_[i]);
  }

  /// Assigns the detections of one camera anew to what the other cameras show; true when anything changed.
  bool Reassign(size_t first, size_t last) {
    const std::vector<int> before(group_.begin() + static_cast<std::ptrdiff_t>(first),
                                  group_.begin() + static_cast<std::ptrdiff_t>(last));
    for (size_t i = first; i < last; ++i) Take(i);
    std::vector<int> rest;
    for (size_t g = 0; g < members_.size(); ++g) {
      if (!members_[g].empty()) rest.push_back(static_cast<int>(g));
    }
    Eigen::MatrixXd gain(static_cast<Eigen::Index>(last - first), static_cast<Eigen::Index>(rest.size()));
    for (size_t k = 0; k < rest.size(); ++k) {
      const Sketch sketch = MakeSketch(rest[k]);
      for (size_t i = first; i < last; ++i) gain(i - first, k) = Gain(i, rest[k], sketch);
    }
    const std::vector<int> choice = BestAssignment(gain);
    size_t free = 0;
    for (size_t i = first; i < last; ++i) {
      if (choice[i - first] >= 0) {
        Put(i, rest[choice[i - first]]);
        continue;
      }
      while (!members_[free].empty() || std::count(before.begin(), before.end(), static_cast<int>(free))) ++free;
      const int own = before[i - first];
      Put(i, members_[own].empty() ? own : static_cast<int>(free));
    }
    return !std::equal(before.begin(), before.end(), group_.begin() + static_cast<std::ptrdiff_t>(first));
  }

  const std::vector<int>& group() const { return group_; }

 private:
  void Add(size_t i, int g, int sign) {
    std::vector<RaySum>& sums = sums_[g];
    sums.resize(std::max(sums.size(), candidates_[i].rays.size()));
    for (size_t j = 0; j < candidates_[i].rays.size(); ++j) {
      if (candidates_[i].is_seen[j]) sums[j].Add(candidates_[i], j, sign);
    }
  }
  void Put(size_t i, int g) {
    group_[i] = g;
    members_[g].push_back(i);
    Add(i, g, 1);
  }
  void Take(size_t i) {
    auto& members = members_[group_[i]];
    members.erase(std::find(members.begin(), members.end(), i));
    if (members.empty()) {
      sums_[group_[i]].clear();  // no rounding is left behind
    } else {
      Add(i, group_[i], -1);
    }
  }
  Sketch MakeSketch(int g) const {
    Sketch sketch;
    if (members_[g].size() < 2) return sketch;
    for (const RaySum& sum : sums_[g]) sketch.push_back(Solve(sum));
    return sketch;
  }
  /// What a detection adds to a group: its evidence beside every member, from the members' common points where there are some.
  double Gain(size_t i, int g, const Sketch& sketch) const {
    double pairs = 0;
    for (const size_t member : members_[g]) pairs += pairs_(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(member));
    if (members_[g].size() < 2) return pairs;
    int agreeing = 0;
    const double whole = SketchEvidence(candidates_[i], sketch, sigma_px_, options_, &agreeing);
    return std::isfinite(whole) ? whole * static_cast<double>(members_[g].size()) : pairs;
  }

  const std::vector<Candidate>& candidates_;
  std::vector<int> group_;
  const double sigma_px_;
  const AssociationOptions& options_;
  const Eigen::MatrixXd& pairs_;
  std::vector<std::vector<RaySum>> sums_;     // [group][joint]
  std::vector<std::vector<size_t>> members_;  // [group]
};

}  // namespace

std::vector<int> ClusterCandidates(const std::vector<Candidate>& candidates, double sigma_px,
                                   const AssociationOptions& options) {
  constexpr int kMaxSweeps = 6;
  const Eigen::MatrixXd pairs = PairMatrix(candidates, sigma_px, options);
  Groups groups(candidates, Contract(pairs), sigma_px, options, pairs);
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    bool changed = false;
    for (size_t first = 0; first < candidates.size();) {
      size_t last = first + 1;
      while (last < candidates.size() && candidates[last].camera_idx == candidates[first].camera_idx) ++last;
      changed |= groups.Reassign(first, last);
      first = last;
    }
    if (!changed) break;
  }
  return groups.group();
}

}  // namespace mvstudio::triangulate::internal
