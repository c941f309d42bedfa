#include "calib/rig/free_boards.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "core/format.h"

namespace mvstudio::calib {
namespace {

/// The boards that one time step shows, each with a view of it.
using Shown = std::map<int, const View*>;

double MovedBy(const View& seen, const geometry::Rigid3& before, const geometry::Rigid3& after) {
  double squares = 0;
  for (Eigen::Index i = 0; i < seen.size(); ++i)
    squares += (after * seen.x_in_board.col(i) - before * seen.x_in_board.col(i)).squaredNorm();
  return std::sqrt(squares / static_cast<double>(std::max<Eigen::Index>(1, seen.size())));
}

}  // namespace

void SeparateBoards(const std::vector<std::vector<View>*>& lists, std::vector<int64_t>* frames) {
  std::map<std::pair<int, int>, int> index;  // by board and frame
  for (const std::vector<View>* views : lists) {
    for (const View& view : *views) index[{view.board, view.frame}] = 0;
  }
  std::vector<int64_t> numbers;
  for (auto& [key, place] : index)
    place = static_cast<int>(numbers.size()), numbers.push_back((*frames)[static_cast<size_t>(key.second)]);
  for (std::vector<View>* views : lists) {
    for (View& view : *views) view.frame = index.at({view.board, view.frame});
  }
  *frames = std::move(numbers);
}

std::vector<BoardMove> FindBoardMoves(const std::vector<View>& views, const RigState& state) {
  constexpr double kWorthTelling = 0.2;  // of the largest
  std::map<int64_t, Shown> by_step;
  for (const View& view : views) {
    if ((view.weights.array() > 0).any()) by_step[state.frames[static_cast<size_t>(view.frame)]].insert({view.board, &view});
  }
  std::map<std::pair<int, int>, std::pair<int64_t, geometry::Rigid3>> last;  // per pair: a_from_b when it was seen before
  std::vector<BoardMove> moves;
  double largest = 0;
  for (const auto& [step, shown] : by_step) {
    for (const auto& [a, view_a] : shown) {
      for (const auto& [b, view_b] : shown) {
        if (b <= a) continue;
        const geometry::Rigid3 a_from_b = geometry::Inverse(state.world_from_board[static_cast<size_t>(view_a->frame)]) *
                                          state.world_from_board[static_cast<size_t>(view_b->frame)];
        const auto found = last.find({a, b});
        if (found != last.end())
          moves.push_back({a, b, found->second.first, step, MovedBy(*view_b, found->second.second, a_from_b)});
        if (found != last.end()) largest = std::max(largest, moves.back().moved_m);
        last[{a, b}] = {step, a_from_b};
      }
    }
  }
  const auto small = [&](const BoardMove& move) { return move.moved_m < kWorthTelling * largest; };
  moves.erase(std::remove_if(moves.begin(), moves.end(), small), moves.end());
  return moves;
}

std::string ToString(const std::vector<BoardMove>& moves) {
  constexpr size_t kTold = 4;
  std::map<std::pair<int64_t, int64_t>, BoardMove> largest;  // by time step
  for (const BoardMove& move : moves) {
    BoardMove& known = largest[{move.after, move.before}];
    if (move.moved_m > known.moved_m) known = move;
  }
  std::string text;
  size_t told = 0;
  for (const auto& [steps, move] : largest) {
    if (++told > kTold) break;
    text += Format("%sboard %d moved against board %d by %s mm between time steps %lld and %lld", told > 1 ? ", " : "",
                   move.board_b, move.board_a,
                   (move.moved_m < 0.1 ? Format("%.2g", 1e3 * move.moved_m) : Format("%.0f", 1e3 * move.moved_m)).c_str(),
                   static_cast<long long>(move.before), static_cast<long long>(move.after));
  }
  return largest.size() > kTold ? text + Format(" and %zu times more", largest.size() - kTold) : text;
}

}  // namespace mvstudio::calib
