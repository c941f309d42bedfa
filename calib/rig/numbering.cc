#include "calib/rig/numbering.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
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

Grid GridOf(const std::vector<View>& views) {
  Grid grid;
  grid.low.setConstant(std::numeric_limits<double>::infinity());
  grid.high = -grid.low;
  grid.step = std::numeric_limits<double>::infinity();
  for (const View& view : views) {
    const Eigen::Matrix2Xd xy = view.x_in_board.topRows<2>();
    grid.low = grid.low.cwiseMin(xy.rowwise().minCoeff()), grid.high = grid.high.cwiseMax(xy.rowwise().maxCoeff());
    for (Eigen::Index i = 0; i + 1 < xy.cols(); ++i) grid.step = std::min(grid.step, (xy.col(i + 1) - xy.col(i)).norm());
  }
  return grid;
}

/// board_from_renumbered: where the corner is that this camera calls by the number of another.
struct Hypothesis {
  std::string what;
  Rigid3 renumber;
};

/// About the middle of a board whose least and greatest coordinates sum up to `ends`.
Rigid3 HalfTurn(const Eigen::Vector2d& ends) {
  Rigid3 turn;
  turn.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0, kPi));
  turn.translation << ends, 0;
  return turn;
}

std::vector<Hypothesis> Hypotheses(const Grid& grid) {
  std::vector<Hypothesis> all = {{"turned by half a turn", HalfTurn(grid.low + grid.high)}};
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
  int turned = -1;      ///< 1: they number the board from different ends, 0: from the same; -1: cannot be said
};

/// Distances of the boards from where a relative pose puts them: as numbered, and with one of the two turned.
struct TurnDistances {
  double same = 0, turned = 0;
  double least() const { return std::min(same, turned); }
};

std::vector<TurnDistances> DistancesFor(const Rigid3& a_from_b, const std::vector<SharedFrame>& frames,
                                        const std::vector<Rigid3>& poses, const Rigid3& turn, const Grid& grid) {
  std::vector<TurnDistances> distances;
  for (const SharedFrame& frame : frames) {
    const Rigid3 from_b = a_from_b * poses[frame.b];
    distances.push_back({Apart(poses[frame.a], from_b, grid), Apart(poses[frame.a] * turn, from_b, grid)});
  }
  return distances;
}

double MedianOfLeast(const std::vector<TurnDistances>& distances) {
  std::vector<double> least;
  for (const TurnDistances& d : distances) least.push_back(d.least());
  return UpperMedian(std::move(least));
}

/// Distances by the relative pose that most frames agree on; empty where they agree on none. Frames as they are numbered come
/// first: a board that does not move agrees with either.
std::vector<TurnDistances> AgreedDistances(const std::vector<SharedFrame>& frames, const std::vector<Rigid3>& poses,
                                           const Grid& grid) {
  constexpr size_t kMinFrames = 3, kCandidates = 20;
  if (frames.size() < kMinFrames) return {};
  const Rigid3 turn = HalfTurn(grid.low + grid.high), none;
  std::vector<TurnDistances> best;
  double median = std::numeric_limits<double>::infinity();
  for (const Rigid3& by : {none, turn}) {
    const double limit = median / (best.empty() ? 1 : kClear);
    const size_t count = std::min(kCandidates, frames.size());
    for (size_t i = 0; i < count; ++i) {
      const SharedFrame& frame = frames[i * frames.size() / count];
      auto distances = DistancesFor(poses[frame.a] * by * Inverse(poses[frame.b]), frames, poses, turn, grid);
      const double at = MedianOfLeast(distances);
      if (at < std::min(limit, median)) median = at, best = std::move(distances);
    }
  }
  return median < kMaxMended ? best : std::vector<TurnDistances>();
}

/// The frames that two cameras share, with what their relative pose says: `a_from_b`, where it is given and explains them, or
/// the one that most of them agree on.
std::vector<SharedFrame> CompareTurns(const std::map<int, size_t>& views_a, const std::map<int, size_t>& views_b,
                                      const std::vector<Rigid3>& poses, const Grid& grid,
                                      const std::optional<Rigid3>& a_from_b) {
  std::vector<SharedFrame> frames;
  for (const auto& [frame, a] : views_a) {
    const auto b = views_b.find(frame);
    if (b != views_b.end()) frames.push_back({a, b->second, -1});
  }
  if (frames.empty()) return {};
  std::vector<TurnDistances> distances;
  if (a_from_b) distances = DistancesFor(*a_from_b, frames, poses, HalfTurn(grid.low + grid.high), grid);
  if (distances.empty() || !(MedianOfLeast(distances) < kMaxMended)) distances = AgreedDistances(frames, poses, grid);
  for (size_t i = 0; i < distances.size(); ++i) {
    const TurnDistances& d = distances[i];
    const bool clear = d.least() < kMaxMended && kClear * d.least() < std::max(d.same, d.turned);
    if (clear) frames[i].turned = d.turned < d.same;
  }
  return frames;
}

/// The views of one frame that are linked to `first`, with 1 for those that are numbered from the other end than it; empty
/// when the links contradict each other.
std::map<size_t, int> LinkedTo(size_t first, const std::vector<SharedFrame>& links) {
  std::map<size_t, int> ends = {{first, 0}};
  for (bool grown = true; grown;) {
    grown = false;
    for (const SharedFrame& link : links) {
      if (link.turned < 0) continue;
      const auto a = ends.find(link.a), b = ends.find(link.b);
      if (a != ends.end() && b != ends.end() && (a->second ^ b->second) != link.turned) return {};
      if ((a == ends.end()) == (b == ends.end())) continue;
      grown = true;
      a == ends.end() ? ends[link.a] = b->second ^ link.turned : ends[link.b] = a->second ^ link.turned;
    }
  }
  return ends;
}

/// Of the views of one frame, the fewer that are numbered from one end; the later camera's where they are as many. `group`
/// receives the first view that each is linked to.
void MarkTurned(const std::vector<View>& views, const std::vector<SharedFrame>& links, std::vector<bool>* turned,
                std::vector<size_t>* group) {
  std::map<int, size_t> by_camera;
  for (const SharedFrame& link : links)
    by_camera[views[link.a].camera_idx] = link.a, by_camera[views[link.b].camera_idx] = link.b;
  std::set<size_t> done;
  for (const auto& [camera, view] : by_camera) {
    if (done.count(view) > 0) continue;
    const std::map<size_t, int> ends = LinkedTo(view, links);
    size_t others = 0;
    for (const auto& [linked, end] : ends) others += static_cast<size_t>(end), done.insert(linked), (*group)[linked] = view;
    const int fewer = 2 * others > ends.size() ? 0 : 1;
    for (const auto& [linked, end] : ends) (*turned)[linked] = end == fewer;
    done.insert(view);
  }
}

/// Views that one camera has of the board one after the other, and whether it turns between them unless its numbering does:
/// votes for the groups of both.
std::map<std::pair<size_t, size_t>, int> TurnsInTime(const std::map<int, std::map<int, size_t>>& of_camera,
                                                     const std::vector<Rigid3>& poses, const std::vector<bool>& turned,
                                                     const std::vector<size_t>& group, const Grid& grid) {
  constexpr int kReach = 2;
  const Rigid3 turn = HalfTurn(grid.low + grid.high);
  std::map<std::pair<size_t, size_t>, int> votes;
  for (const auto& [camera, frames] : of_camera) {
    for (auto a = frames.begin(); a != frames.end() && std::next(a) != frames.end(); ++a) {
      const auto b = std::next(a);
      if (b->first - a->first > kReach) continue;
      const double same = Apart(poses[a->second], poses[b->second], grid),
                   other = Apart(poses[a->second], poses[b->second] * turn, grid);
      if (!(kClear * std::min(same, other) < std::max(same, other))) continue;
      const bool differ = (other < same) != (turned[a->second] != turned[b->second]);
      votes[{group[a->second], group[b->second]}] += differ ? 1 : -1;
    }
  }
  return votes;
}

/// Frames after each other numbered from one end, so that the board does not seem to turn in between; of the views that are
/// linked in this way, the fewer count as turned.
void TurnAlikeInTime(const std::map<std::pair<size_t, size_t>, int>& votes, const std::vector<size_t>& group,
                     std::vector<bool>* turned) {
  std::map<size_t, std::vector<std::pair<size_t, bool>>> links;
  for (const auto& [pair, vote] : votes) {
    if (pair.first == pair.second || vote == 0) continue;
    links[pair.first].push_back({pair.second, vote > 0}), links[pair.second].push_back({pair.first, vote > 0});
  }
  std::map<size_t, std::pair<size_t, bool>> place;  // group -> the first one that it is linked to, and whether it differs
  for (const auto& [start, unused] : links) {
    if (place.count(start) > 0) continue;
    place[start] = {start, false};
    for (std::vector<size_t> open = {start}; !open.empty();) {
      const size_t at = open.back();
      open.pop_back();
      for (const auto& [next, differs] : links[at]) {
        if (place.insert({next, {start, place[at].second != differs}}).second) open.push_back(next);
      }
    }
  }
  std::map<size_t, int> balance;  // turned views less others
  const auto flip = [&](size_t v, bool also) { (*turned)[v] = (*turned)[v] != also; };
  for (size_t v = 0; v < group.size(); ++v) {
    const auto found = place.find(group[v]);
    if (found == place.end()) continue;
    flip(v, found->second.second);
    balance[found->second.first] += (*turned)[v] ? 1 : -1;
  }
  for (size_t v = 0; v < group.size(); ++v) {
    const auto found = place.find(group[v]);
    if (found != place.end()) flip(v, balance[found->second.first] > 0);
  }
}

}  // namespace

bool CanBeTurned(const std::vector<Board>& boards) {
  return boards.size() == 1 && (boards[0].kind == Board::Kind::kChessboard || boards[0].kind == Board::Kind::kGrid);
}

std::vector<bool> FindTurnedViews(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board,
                                  const std::vector<Rigid3>* cam_from_world) {
  std::vector<bool> turned(views.size(), false);
  if (views.empty()) return turned;
  const Grid grid = GridOf(views);
  if (!(grid.step > 0) || !std::isfinite(grid.step)) return turned;
  std::map<int, std::map<int, size_t>> of_camera;  // camera -> frame -> view
  for (size_t v = 0; v < views.size(); ++v) of_camera[views[v].camera_idx][views[v].frame] = v;
  std::map<int, std::vector<SharedFrame>> of_frame;
  for (auto a = of_camera.begin(); a != of_camera.end(); ++a) {
    for (auto b = std::next(a); b != of_camera.end(); ++b) {
      std::optional<Rigid3> a_from_b;
      if (cam_from_world)
        a_from_b = (*cam_from_world)[static_cast<size_t>(a->first)] * Inverse((*cam_from_world)[static_cast<size_t>(b->first)]);
      for (const SharedFrame& shared : CompareTurns(a->second, b->second, cam_from_board, grid, a_from_b))
        of_frame[views[shared.a].frame].push_back(shared);
    }
  }
  std::vector<size_t> group(views.size());
  std::iota(group.begin(), group.end(), size_t{0});
  for (const auto& [frame, shared] : of_frame) MarkTurned(views, shared, &turned, &group);
  if (std::find(turned.begin(), turned.end(), true) != turned.end())
    TurnAlikeInTime(TurnsInTime(of_camera, cam_from_board, turned, group, grid), group, &turned);
  return turned;
}

void TurnViews(const Eigen::Matrix3Xd& board, const std::vector<bool>& turned, std::vector<View>* views,
               std::vector<Rigid3>* cam_from_board) {
  Eigen::Vector2d ends = board.topRows<2>().rowwise().minCoeff() + board.topRows<2>().rowwise().maxCoeff();
  Rigid3 turn = HalfTurn(ends);
  for (size_t v = 0; v < views->size(); ++v) {
    if (!turned[v]) continue;
    View& view = (*views)[v];
    for (int& id : view.corner_ids) id = static_cast<int>(board.cols()) - 1 - id;
    view.x_in_board.topRows<2>() = (-view.x_in_board.topRows<2>()).colwise() + ends;
    (*cam_from_board)[v] = (*cam_from_board)[v] * turn;
  }
}

std::string NumberingText(const TurnedCamera& camera) {
  return Format("camera %s numbers the board's corners from the other end in %d of %d views; they were turned round",
                camera.camera.c_str(), camera.num_turned, camera.num_views);
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
