#include "calib/rig/numbering.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "calib/rig/board_grid.h"
#include "core/format.h"
#include "core/join.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;
using internal::Apart;
using internal::Grid;
using internal::kClear;
using internal::kMaxMended;
using internal::Turn;

constexpr size_t kMinShared = 5, kMaxShared = 40;

/// Poses of boards in two cameras.
using Pairs = std::vector<std::pair<Rigid3, Rigid3>>;

/// board_from_renumbered: where the corner is that this camera calls by the number of another.
struct Hypothesis {
  std::string what;
  Rigid3 renumber;
};

bool IsSquare(const Grid& grid) {
  const Eigen::Vector2d extent = grid.high - grid.low;
  return std::abs(extent.x() - extent.y()) < 1e-6 * grid.step;
}

std::vector<Hypothesis> Hypotheses(const Grid& grid) {
  std::vector<Hypothesis> all = {{"turned by half a turn", Turn(grid.low + grid.high, 2)}};
  if (IsSquare(grid)) {
    for (const int quarters : {1, 3}) all.push_back({"turned by a quarter turn", Turn(grid.low + grid.high, quarters)});
  }
  const auto shift = [&](const char* what, double columns, double rows) {
    Rigid3 by;
    by.translation << grid.step * columns, grid.step * rows, 0;
    all.push_back({what, by});
  };
  shift("shifted by a column", 1, 0), shift("shifted by a column", -1, 0);
  shift("shifted by a row", 0, 1), shift("shifted by a row", 0, -1);
  return all;
}

/// Median distance of the boards from where the most central relative pose puts them.
double Spread(const Pairs& pairs, const Rigid3& renumber, const Grid& grid) {
  double best = std::numeric_limits<double>::infinity();
  for (const auto& [a, b] : pairs) {
    const Rigid3 a_from_b = a * renumber * Inverse(b);
    std::vector<double> apart;
    for (const auto& [x, y] : pairs) apart.push_back(Apart(x * renumber, a_from_b * y, grid));
    best = std::min(best, UpperMedian(std::move(apart)));
  }
  return best;
}

Pairs Shared(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board, int a, int b) {
  std::map<std::pair<int, int>, Rigid3> of_a;
  Pairs pairs;
  for (size_t v = 0; v < views.size(); ++v)
    if (views[v].camera_idx == a) of_a[{views[v].frame, views[v].board}] = cam_from_board[v];
  for (size_t v = 0; v < views.size(); ++v) {
    const auto found = views[v].camera_idx == b ? of_a.find({views[v].frame, views[v].board}) : of_a.end();
    if (found != of_a.end()) pairs.push_back({found->second, cam_from_board[v]});
  }
  if (pairs.size() <= kMaxShared) return pairs;
  Pairs thinned;
  for (size_t i = 0; i < kMaxShared; ++i) thinned.push_back(pairs[i * pairs.size() / kMaxShared]);
  return thinned;
}

struct PairFault {
  int a = 0, b = 0;
  std::string what;
  double spread = 0, mended = 0;
};

std::optional<PairFault> FaultOf(const Pairs& pairs, int a, int b, const Grid& grid) {
  PairFault fault{a, b, "", Spread(pairs, Rigid3(), grid), std::numeric_limits<double>::infinity()};
  for (const Hypothesis& hypothesis : Hypotheses(grid)) {
    const double spread = Spread(pairs, hypothesis.renumber, grid);
    if (spread < fault.mended) fault.mended = spread, fault.what = hypothesis.what;
  }
  const bool believed = fault.mended < kMaxMended && kClear * fault.mended < fault.spread;
  return believed ? std::optional<PairFault>(fault) : std::nullopt;
}

/// The cameras that disagree with most of the others they share boards with; both of a pair where neither does.
std::vector<int> Suspects(const std::vector<PairFault>& faults, const std::map<int, int>& partners) {
  std::map<int, int> broken;
  for (const PairFault& fault : faults) ++broken[fault.a], ++broken[fault.b];
  std::set<int> guilty;
  for (const auto& [camera, count] : broken)
    if (2 * count > partners.at(camera)) guilty.insert(camera);
  std::set<int> named;
  for (const PairFault& fault : faults) {
    const bool a = guilty.count(fault.a) > 0, b = guilty.count(fault.b) > 0;
    if (a || !b) named.insert(fault.a);
    if (b || !a) named.insert(fault.b);
  }
  return {named.begin(), named.end()};
}

}  // namespace

std::string NumberingText(const RotatedCamera& camera) {
  return Format("camera %s numbers the board's corners from another end in %d of %d views; they were turned round",
                camera.camera.c_str(), camera.num_rotated, camera.num_views);
}

std::string ToString(const NumberingFault& fault) {
  const std::string text = Format(": so renumbered, boards lie within %.1f %% of their size instead of %.0f %%",
                                  100 * fault.mended_spread, 100 * fault.spread);
  return "the corners' numbering of camera " + Join(fault.cameras, ", ") + " is " + fault.what + " against the others" + text;
}

std::vector<NumberingFault> FindNumberingFaults(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board,
                                                const std::vector<std::string>& camera_names) {
  if (views.empty()) return {};
  const Grid grid = internal::GridOf(views);
  if (!(grid.step > 0) || !std::isfinite(grid.step)) return {};
  std::map<std::string, std::vector<PairFault>> by_kind;
  std::map<int, int> partners;
  const int n = static_cast<int>(camera_names.size());
  for (int a = 0; a < n; ++a) {
    for (int b = a + 1; b < n; ++b) {
      const Pairs pairs = Shared(views, cam_from_board, a, b);
      if (pairs.size() < kMinShared) continue;
      ++partners[a], ++partners[b];
      if (const auto fault = FaultOf(pairs, a, b, grid)) by_kind[fault->what].push_back(*fault);
    }
  }
  std::vector<NumberingFault> faults;
  for (const auto& [what, of_kind] : by_kind) {
    NumberingFault fault{{}, what, of_kind[0].spread, of_kind[0].mended};
    for (const int camera : Suspects(of_kind, partners)) fault.cameras.push_back(camera_names[static_cast<size_t>(camera)]);
    faults.push_back(fault);
  }
  return faults;
}

}  // namespace mvstudio::calib
