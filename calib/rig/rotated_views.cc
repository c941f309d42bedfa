#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "calib/rig/board_grid.h"
#include "calib/rig/numbering.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;
using internal::Grid;

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
    for (const Rigid3& turn : turns) apart.push_back(internal::Apart(poses[frame.a] * turn, from_b, grid));
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
  for (auto other = distances.begin(); other != distances.end(); ++other) {
    if (other != best && !(internal::kClear * *best < *other)) return -1;
  }
  return static_cast<int>(best - distances.begin());
}

/// Distances by the relative pose that most frames agree on; empty where they agree on none. Frames as they are numbered come
/// first: a board that does not move agrees with any.
std::vector<TurnDistances> AgreedDistances(const std::vector<SharedFrame>& frames, const std::vector<Rigid3>& poses,
                                           const Turns& turns, const Grid& grid) {
  constexpr size_t kMinFrames = 3, kCandidates = 20;
  if (frames.size() < kMinFrames) return {};
  std::vector<TurnDistances> best;
  double median = std::numeric_limits<double>::infinity();
  for (const Rigid3& by : turns) {
    const double limit = median / (best.empty() ? 1 : internal::kClear);
    const size_t count = std::min(kCandidates, frames.size());
    for (size_t i = 0; i < count; ++i) {
      const SharedFrame& frame = frames[i * frames.size() / count];
      auto distances = DistancesFor(poses[frame.a] * by * Inverse(poses[frame.b]), frames, poses, turns, grid);
      const double at = MedianOfLeast(distances);
      if (at < std::min(limit, median)) median = at, best = std::move(distances);
    }
  }
  return median < internal::kMaxMended ? best : std::vector<TurnDistances>();
}

/// The frames that two cameras share, with what their relative pose says: `a_from_b`, where it is given and explains them, or
/// the one that most of them agree on.
std::vector<SharedFrame> CompareTurns(const std::map<int, size_t>& views_a, const std::map<int, size_t>& views_b,
                                      const std::vector<Rigid3>& poses, const Turns& turns, const Grid& grid,
                                      const std::optional<Rigid3>& a_from_b) {
  std::vector<SharedFrame> frames;
  for (const auto& [frame, a] : views_a) {
    const auto b = views_b.find(frame);
    if (b != views_b.end()) frames.push_back({a, b->second, -1});
  }
  if (frames.empty()) return {};
  std::vector<TurnDistances> distances;
  if (a_from_b) distances = DistancesFor(*a_from_b, frames, poses, turns, grid);
  if (distances.empty() || !(MedianOfLeast(distances) < internal::kMaxMended))
    distances = AgreedDistances(frames, poses, turns, grid);
  for (size_t i = 0; i < distances.size(); ++i) {
    const bool near = *std::min_element(distances[i].begin(), distances[i].end()) < internal::kMaxMended;
    if (near) frames[i].turn = ClearTurn(distances[i]);
  }
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

/// Numberings of views as likenesses of the board, those that count as turned: how often each occurs.
using TurnCounts = std::array<int, 4>;

/// The numbering that occurs most; of the lowest number where several do.
int CommonEnd(const TurnCounts& counts) {
  return static_cast<int>(std::max_element(counts.begin(), counts.end()) - counts.begin());
}

/// Turns the views of one frame to the numbering of most of them, to the first camera's where there are as many. `group`
/// receives the first view that each is linked to.
void MarkRotated(const std::vector<View>& views, const std::vector<SharedFrame>& links, int num_turns,
                 std::vector<int>* rotated, std::vector<size_t>* group) {
  std::map<int, size_t> by_camera;
  for (const SharedFrame& link : links)
    by_camera[views[link.a].camera_idx] = link.a, by_camera[views[link.b].camera_idx] = link.b;
  std::set<size_t> done;
  for (const auto& [camera, view] : by_camera) {
    if (!done.insert(view).second) continue;
    const std::map<size_t, int> ends = LinkedTo(view, links, num_turns);
    TurnCounts counts{};
    for (const auto& [linked, end] : ends) ++counts[static_cast<size_t>(end)];
    for (const auto& [linked, end] : ends) {
      (*rotated)[linked] = (end - CommonEnd(counts) + num_turns) % num_turns;
      (*group)[linked] = view;
      done.insert(linked);
    }
  }
}

/// Views that one camera has of the board one after the other, and by which turn the numbering of their groups differs unless
/// the board turns between them: votes for each pair of groups.
std::map<std::pair<size_t, size_t>, TurnCounts> TurnsInTime(const std::map<int, std::map<int, size_t>>& of_camera,
                                                            const std::vector<Rigid3>& poses, const std::vector<int>& rotated,
                                                            const std::vector<size_t>& group, const Turns& turns,
                                                            const Grid& grid) {
  constexpr int kReach = 2;
  const int num_turns = static_cast<int>(turns.size());
  std::map<std::pair<size_t, size_t>, TurnCounts> votes;
  for (const auto& [camera, frames] : of_camera) {
    for (auto a = frames.begin(); a != frames.end() && std::next(a) != frames.end(); ++a) {
      const auto b = std::next(a);
      if (b->first - a->first > kReach) continue;
      const int between = ClearTurn(DistancesFor({}, {{a->second, b->second, -1}}, poses, turns, grid)[0]);
      if (between < 0) continue;
      const int differs = (rotated[a->second] - rotated[b->second] - between + 2 * num_turns) % num_turns;
      ++votes[{group[a->second], group[b->second]}][static_cast<size_t>(differs)];
    }
  }
  return votes;
}

/// Frames after each other numbered from one end, so that the board does not seem to turn in between; of the views that are
/// linked in this way, those of the commonest numbering count as not turned.
void TurnAlikeInTime(const std::map<std::pair<size_t, size_t>, TurnCounts>& votes, const std::vector<size_t>& group,
                     int num_turns, std::vector<int>* rotated) {
  std::map<size_t, std::vector<std::pair<size_t, int>>> links;
  for (const auto& [pair, counts] : votes) {
    const int differs = CommonEnd(counts), most = counts[static_cast<size_t>(differs)];
    if (pair.first == pair.second || std::count(counts.begin(), counts.end(), most) > 1) continue;
    links[pair.first].push_back({pair.second, differs});
    links[pair.second].push_back({pair.first, (num_turns - differs) % num_turns});
  }
  std::map<size_t, std::pair<size_t, int>> place;  // group -> the first one that it is linked to, and by what it differs
  for (const auto& [start, unused] : links) {
    if (place.count(start) > 0) continue;
    place[start] = {start, 0};
    for (std::vector<size_t> open = {start}; !open.empty();) {
      const size_t at = open.back();
      open.pop_back();
      for (const auto& [next, differs] : links[at]) {
        if (place.insert({next, {start, (place[at].second + differs) % num_turns}}).second) open.push_back(next);
      }
    }
  }
  std::map<size_t, TurnCounts> counts;
  for (size_t v = 0; v < group.size(); ++v) {
    const auto found = place.find(group[v]);
    if (found == place.end()) continue;
    (*rotated)[v] = ((*rotated)[v] + found->second.second) % num_turns;
    ++counts[found->second.first][static_cast<size_t>((*rotated)[v])];
  }
  for (size_t v = 0; v < group.size(); ++v) {
    const auto found = place.find(group[v]);
    if (found != place.end()) (*rotated)[v] = ((*rotated)[v] - CommonEnd(counts[found->second.first]) + num_turns) % num_turns;
  }
}

}  // namespace

int NumNumberings(const std::vector<Board>& boards) {
  if (boards.size() != 1) return 1;
  Board points = boards[0];  // corner files may number a chessboard against its colours
  if (points.kind == Board::Kind::kChessboard) points.kind = Board::Kind::kGrid;
  return NumLikeTurns(points);
}

std::vector<int> FindRotatedViews(const Eigen::Matrix3Xd& board, int num_turns, const std::vector<View>& views,
                                  const std::vector<Rigid3>& cam_from_board, const std::vector<Rigid3>* cam_from_world) {
  std::vector<int> rotated(views.size(), 0);
  if (views.empty() || num_turns < 2) return rotated;
  Grid grid = internal::NoGrid();
  internal::Widen(board, &grid);
  if (!(grid.step > 0) || !std::isfinite(grid.step)) return rotated;
  const int quarters = 4 / num_turns;
  Turns turns;
  for (int k = 0; k < num_turns; ++k) turns.push_back(internal::Turn(grid.low + grid.high, k * quarters));
  std::map<int, std::map<int, size_t>> of_camera;  // camera -> frame -> view
  for (size_t v = 0; v < views.size(); ++v) of_camera[views[v].camera_idx][views[v].frame] = v;
  std::map<int, std::vector<SharedFrame>> of_frame;
  for (auto a = of_camera.begin(); a != of_camera.end(); ++a) {
    for (auto b = std::next(a); b != of_camera.end(); ++b) {
      std::optional<Rigid3> a_from_b;
      if (cam_from_world)
        a_from_b = (*cam_from_world)[static_cast<size_t>(a->first)] * Inverse((*cam_from_world)[static_cast<size_t>(b->first)]);
      for (const SharedFrame& shared : CompareTurns(a->second, b->second, cam_from_board, turns, grid, a_from_b))
        of_frame[views[shared.a].frame].push_back(shared);
    }
  }
  std::vector<size_t> group(views.size());
  std::iota(group.begin(), group.end(), size_t{0});
  for (const auto& [frame, shared] : of_frame) MarkRotated(views, shared, num_turns, &rotated, &group);
  if (std::any_of(rotated.begin(), rotated.end(), [](int turn) { return turn != 0; }))
    TurnAlikeInTime(TurnsInTime(of_camera, cam_from_board, rotated, group, turns, grid), group, num_turns, &rotated);
  for (int& turn : rotated) turn *= quarters;
  return rotated;
}

int RotatedCorner(int id, int num_corners, int quarters) {
  if (quarters % 2 == 0) return quarters == 0 ? id : num_corners - 1 - id;
  const int side = static_cast<int>(std::lround(std::sqrt(num_corners)));
  const int row = id / side, col = id % side;
  return quarters == 1 ? (side - 1 - col) * side + row : col * side + side - 1 - row;
}

void TurnViews(const Eigen::Matrix3Xd& board, const std::vector<int>& rotated, std::vector<View>* views,
               std::vector<Rigid3>* cam_from_board) {
  const Eigen::Vector2d ends = board.topRows<2>().rowwise().minCoeff() + board.topRows<2>().rowwise().maxCoeff();
  for (size_t v = 0; v < views->size(); ++v) {
    if (rotated[v] == 0) continue;
    View& view = (*views)[v];
    for (size_t i = 0; i < view.corner_ids.size(); ++i) {
      int& id = view.corner_ids[i];
      id = RotatedCorner(id, static_cast<int>(board.cols()), rotated[v]);
      view.x_in_board.col(static_cast<Eigen::Index>(i)) = board.col(id);
    }
    (*cam_from_board)[v] = (*cam_from_board)[v] * internal::Turn(ends, rotated[v]);
  }
}

}  // namespace mvstudio::calib
