#include "calib/rig/numbering.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/format.h"
#include "core/join.h"
#include "core/statistics.h"
#include "core/units.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr size_t kMinShared = 5, kMaxShared = 40;
constexpr double kClear = 4, kMaxMended = 0.1;

/// Poses of boards in two cameras.
using Pairs = std::vector<std::pair<Rigid3, Rigid3>>;

/// Extent of the board's corners and the step between neighbours.
struct Grid {
  Eigen::Vector2d low, high;
  double step = 0;
};

Grid NoGrid() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {Eigen::Vector2d::Constant(kInfinity), Eigen::Vector2d::Constant(-kInfinity), kInfinity};
}

void Widen(const Eigen::Matrix3Xd& x_in_board, Grid* grid) {
  const Eigen::Matrix2Xd xy = x_in_board.topRows<2>();
  grid->low = grid->low.cwiseMin(xy.rowwise().minCoeff()), grid->high = grid->high.cwiseMax(xy.rowwise().maxCoeff());
  for (Eigen::Index i = 0; i + 1 < xy.cols(); ++i) grid->step = std::min(grid->step, (xy.col(i + 1) - xy.col(i)).norm());
}

Grid GridOf(const std::vector<View>& views) {
  Grid grid = NoGrid();
  for (const View& view : views) Widen(view.x_in_board, &grid);
  return grid;
}

/// board_from_renumbered: where the corner is that this camera calls by the number of another.
struct Hypothesis {
  std::string what;
  Rigid3 renumber;
};

/// By `quarters` quarter turns about the middle of a board whose least and greatest coordinates sum up to `ends`.
Rigid3 Turn(const Eigen::Vector2d& ends, int quarters) {
  const Eigen::Vector3d middle(ends.x() / 2, ends.y() / 2, 0);
  Rigid3 turn;
  turn.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0, quarters * kPi / 2));
  turn.translation = middle - turn.rotation * middle;
  return turn;
}

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

/// How far two places of the board lie apart, rms over its four outer corners, in its diagonals.
double Apart(const Rigid3& a, const Rigid3& b, const Grid& grid) {
  double sum = 0;
  for (const double x : {grid.low.x(), grid.high.x()}) {
    for (const double y : {grid.low.y(), grid.high.y()})
      sum += (a * Eigen::Vector3d(x, y, 0) - b * Eigen::Vector3d(x, y, 0)).squaredNorm();
  }
  return std::sqrt(sum / 4) / (grid.high - grid.low).norm();
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
std::vector<int> Culprits(const std::vector<PairFault>& faults, const std::map<int, int>& partners) {
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

/// A frame that two cameras share.
struct SharedFrame {
  size_t a = 0, b = 0;  ///< views
  int turn = -1;  ///< of the likenesses of the board, the one by which b's numbering is turned against a's; -1: cannot be said
};

/// The likenesses of a board: the turns after which it looks the same, the first of them none.
using Turns = std::vector<Rigid3>;

/// Distances of a board from where a relative pose puts it, one for each likeness.
using TurnDistances = std::vector<double>;

std::vector<TurnDistances> DistancesFor(const Rigid3& a_from_b, const std::vector<SharedFrame>& frames,
                                        const std::vector<Rigid3>& poses, const Turns& turns, const Grid& grid) {
  std::vector<TurnDistances> distances;
  for (const SharedFrame& frame : frames) {
    const Rigid3 from_b = a_from_b * poses[frame.b];
    TurnDistances& apart = distances.emplace_back();
    for (const Rigid3& turn : turns) apart.push_back(Apart(poses[frame.a] * turn, from_b, grid));
  }
  return distances;
}

double MedianOfLeast(const std::vector<TurnDistances>& distances) {
  std::vector<double> least;
  for (const TurnDistances& d : distances) least.push_back(*std::min_element(d.begin(), d.end()));
  return UpperMedian(std::move(least));
}

/// The likeness that brings the board clearly nearer than every other; -1: none.
int ClearTurn(const TurnDistances& distances) {
  const auto best = std::min_element(distances.begin(), distances.end());
  bool clear = *best < kMaxMended;
  for (auto other = distances.begin(); other != distances.end(); ++other) clear &= other == best || kClear * *best < *other;
  return clear ? static_cast<int>(best - distances.begin()) : -1;
}

/// The frames that two cameras share, with what the relative pose that most of them agree on says. Frames as they are
/// numbered come first: a board that does not move agrees with any.
std::vector<SharedFrame> CompareTurns(const std::map<int, size_t>& views_a, const std::map<int, size_t>& views_b,
                                      const std::vector<Rigid3>& poses, const Turns& turns, const Grid& grid) {
  constexpr size_t kMinFrames = 3, kCandidates = 20;
  std::vector<SharedFrame> frames;
  for (const auto& [frame, a] : views_a) {
    const auto b = views_b.find(frame);
    if (b != views_b.end()) frames.push_back({a, b->second, -1});
  }
  if (frames.size() < kMinFrames) return {};
  std::vector<TurnDistances> best;
  double median = std::numeric_limits<double>::infinity();
  for (const Rigid3& by : turns) {
    const double limit = median / (best.empty() ? 1 : kClear);
    const size_t count = std::min(kCandidates, frames.size());
    for (size_t i = 0; i < count; ++i) {
      const SharedFrame& frame = frames[i * frames.size() / count];
      auto distances = DistancesFor(poses[frame.a] * by * Inverse(poses[frame.b]), frames, poses, turns, grid);
      const double at = MedianOfLeast(distances);
      if (at < std::min(limit, median)) median = at, best = std::move(distances);
    }
  }
  if (!(median < kMaxMended)) return {};
  for (size_t i = 0; i < frames.size(); ++i) frames[i].turn = ClearTurn(best[i]);
  return frames;
}

/// The views of one frame that are linked to `first`, with the likeness that brings each to its numbering; empty when the
/// links contradict each other.
std::map<size_t, int> LinkedTo(size_t first, const std::vector<SharedFrame>& links, int num_turns) {
  std::map<size_t, int> ends = {{first, 0}};
  for (bool grown = true; grown;) {
    grown = false;
    for (const SharedFrame& link : links) {
      if (link.turn < 0) continue;
      const auto a = ends.find(link.a), b = ends.find(link.b);
      if (a != ends.end() && b != ends.end() && (a->second - b->second + num_turns) % num_turns != link.turn) return {};
      if ((a == ends.end()) == (b == ends.end())) continue;
      grown = true;
      if (a == ends.end()) {
        ends[link.a] = (b->second + link.turn) % num_turns;
      } else {
        ends[link.b] = (a->second - link.turn + num_turns) % num_turns;
      }
    }
  }
  return ends;
}

/// The numbering of most of the views; of the first camera where there are as many.
int CommonEnd(const std::map<size_t, int>& ends, int num_turns) {
  std::vector<int> count(static_cast<size_t>(num_turns), 0);
  for (const auto& [view, end] : ends) ++count[static_cast<size_t>(end)];
  return static_cast<int>(std::max_element(count.begin(), count.end()) - count.begin());
}

/// Turns the views of one frame to the numbering of most of them.
void MarkTurned(const std::vector<View>& views, const std::vector<SharedFrame>& links, int num_turns,
                std::vector<int>* turned) {
  std::map<int, size_t> by_camera;
  for (const SharedFrame& link : links)
    by_camera[views[link.a].camera_idx] = link.a, by_camera[views[link.b].camera_idx] = link.b;
  std::set<size_t> done;
  for (const auto& [camera, view] : by_camera) {
    if (!done.insert(view).second) continue;
    const std::map<size_t, int> ends = LinkedTo(view, links, num_turns);
    const int common = CommonEnd(ends, num_turns), quarters = 4 / num_turns;
    for (const auto& [linked, end] : ends) {
      (*turned)[linked] = quarters * ((end - common + num_turns) % num_turns);
      done.insert(linked);
    }
  }
}

}  // namespace

std::vector<int> FindTurnedViews(const Eigen::Matrix3Xd& board, int num_turns, const std::vector<View>& views,
                                 const std::vector<Rigid3>& cam_from_board) {
  std::vector<int> turned(views.size(), 0);
  if (views.empty() || num_turns < 2) return turned;
  Grid grid = NoGrid();
  Widen(board, &grid);
  if (!(grid.step > 0) || !std::isfinite(grid.step)) return turned;
  Turns turns;
  for (int k = 0; k < num_turns; ++k) turns.push_back(Turn(grid.low + grid.high, k * 4 / num_turns));
  std::map<int, std::map<int, size_t>> of_camera;  // camera -> frame -> view
  for (size_t v = 0; v < views.size(); ++v) of_camera[views[v].camera_idx][views[v].frame] = v;
  std::map<int, std::vector<SharedFrame>> of_frame;
  for (auto a = of_camera.begin(); a != of_camera.end(); ++a) {
    for (auto b = std::next(a); b != of_camera.end(); ++b) {
      for (const SharedFrame& shared : CompareTurns(a->second, b->second, cam_from_board, turns, grid))
        of_frame[views[shared.a].frame].push_back(shared);
    }
  }
  for (const auto& [frame, shared] : of_frame) MarkTurned(views, shared, num_turns, &turned);
  return turned;
}

int TurnedCorner(int id, int num_corners, int quarters) {
  if (quarters % 2 == 0) return quarters == 0 ? id : num_corners - 1 - id;
  const int side = static_cast<int>(std::lround(std::sqrt(num_corners)));
  const int row = id / side, col = id % side;
  return quarters == 1 ? (side - 1 - col) * side + row : col * side + side - 1 - row;
}

void TurnViews(const Eigen::Matrix3Xd& board, const std::vector<int>& turned, std::vector<View>* views,
               std::vector<Rigid3>* cam_from_board) {
  const Eigen::Vector2d ends = board.topRows<2>().rowwise().minCoeff() + board.topRows<2>().rowwise().maxCoeff();
  for (size_t v = 0; v < views->size(); ++v) {
    if (turned[v] == 0) continue;
    View& view = (*views)[v];
    for (size_t i = 0; i < view.corner_ids.size(); ++i) {
      int& id = view.corner_ids[i];
      id = TurnedCorner(id, static_cast<int>(board.cols()), turned[v]);
      view.x_in_board.col(static_cast<Eigen::Index>(i)) = board.col(id);
    }
    (*cam_from_board)[v] = (*cam_from_board)[v] * Turn(ends, turned[v]);
  }
}

std::string ToString(const NumberingFault& fault) {
  const std::string text = Format(": so renumbered, boards lie within %.1f %% of their size instead of %.0f %%",
                                  100 * fault.mended_spread, 100 * fault.spread);
  return "the corners' numbering of camera " + Join(fault.cameras, ", ") + " is " + fault.what + " against the others" + text;
}

std::vector<NumberingFault> FindNumberingFaults(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board,
                                                const std::vector<std::string>& camera_names) {
  if (views.empty()) return {};
  const Grid grid = GridOf(views);
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
    for (const int camera : Culprits(of_kind, partners)) fault.cameras.push_back(camera_names[static_cast<size_t>(camera)]);
    faults.push_back(fault);
  }
  return faults;
}

}  // namespace mvstudio::calib
