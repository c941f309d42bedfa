#include "calib/rig/frame_steps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "calib/rig/numbering.h"
#include "core/statistics.h"
#include "core/units.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr int kReach = 6, kShifts = 2 * kReach + 1;  // frames
constexpr size_t kMaxFrames = 120, kCandidatesPerShift = 12;
constexpr size_t kMinFrames = 12;
constexpr double kChangeNats = 8, kNeededNats = 15, kMissingNats = 2;
constexpr double kNoiseFloor = 0.003;  // of the board's distance
constexpr double kNone = std::numeric_limits<double>::infinity();

/// A frame of b and the poses that a has at each shift; null where it has none.
struct Instant {
  int64_t frame = 0;
  const Rigid3* b_from_board = nullptr;
  const Rigid3* a_from_board[kShifts] = {};
};

std::vector<Instant> InstantsOf(const BoardPoses& a, const BoardPoses& b, int64_t base_shift) {
  std::vector<Instant> all;
  for (const auto& [key, pose] : b) {
    Instant instant{key.first, &pose, {}};
    bool any = false;
    for (int s = 0; s < kShifts; ++s) {
      const auto found = a.find({key.first + base_shift + s - kReach, key.second});
      if (found == a.end()) continue;
      instant.a_from_board[s] = &found->second;
      any = true;
    }
    if (any) all.push_back(instant);
  }
  if (all.size() <= kMaxFrames) return all;
  std::vector<Instant> thin;
  for (size_t i = 0; i < kMaxFrames; ++i) thin.push_back(all[i * all.size() / kMaxFrames]);
  return thin;
}

/// Distance between the board and its transferred place over its distance; kNone where a has no pose.
using Distances = std::vector<std::array<double, kShifts>>;

Distances DistancesUnder(const Rigid3& a_from_b, const std::vector<Instant>& instants) {
  Distances distances(instants.size());
  for (size_t i = 0; i < instants.size(); ++i) {
    const Eigen::Vector3d x_in_a = a_from_b * instants[i].b_from_board->translation;
    for (int s = 0; s < kShifts; ++s) {
      const Rigid3* const a = instants[i].a_from_board[s];
      distances[i][s] = a ? (x_in_a - a->translation).norm() / a->translation.norm() : kNone;
    }
  }
  return distances;
}

std::vector<Rigid3> Candidates(const std::vector<Instant>& instants, const BoardTurns& turns) {
  std::vector<Rigid3> candidates;
  for (int s = 0; s < kShifts; ++s) {
    std::vector<const Instant*> with;
    for (const Instant& instant : instants) {
      if (instant.a_from_board[s]) with.push_back(&instant);
    }
    const size_t n = std::min(kCandidatesPerShift, with.size());
    for (size_t k = 0; k < n; ++k) {
      const Instant& instant = *with[k * with.size() / n];
      for (int turn = 0; turn < turns.num; ++turn)
        candidates.push_back(turns.RelativePose(*instant.a_from_board[s], *instant.b_from_board, turn));
    }
  }
  return candidates;
}

/// Median over the frames of the least distance.
double LeastMedian(const Distances& distances) {
  std::vector<double> least;
  for (const auto& row : distances) least.push_back(*std::min_element(row.begin(), row.end()));
  return UpperMedian(std::move(least));
}

double Nats(double distance, double sigma) {
  return distance == kNone ? kMissingNats : std::log1p(distance * distance / (2 * sigma * sigma));
}

double ConstantNats(const Distances& distances, double sigma) {
  double sum = 0;
  for (const auto& row : distances) sum += Nats(row[kReach], sigma);
  return sum;
}

struct Path {
  double nats = kNone;
  std::vector<int> shift;  // per time step: index into the window
};

/// The cheapest sequence of shifts (Viterbi).
Path CheapestPath(const Distances& distances, double sigma) {
  const size_t n = distances.size();
  std::vector<std::array<int, kShifts>> from(n);
  std::array<double, kShifts> sum = {};
  for (size_t i = 0; i < n; ++i) {
    const int cheapest = static_cast<int>(std::min_element(sum.begin(), sum.end()) - sum.begin());
    const double changed = i == 0 ? kNone : sum[cheapest] + kChangeNats;
    for (int s = 0; s < kShifts; ++s) {
      from[i][s] = changed < sum[s] ? cheapest : s;
      sum[s] = std::min(sum[s], changed);
    }
    for (int s = 0; s < kShifts; ++s) sum[s] += Nats(distances[i][s], sigma);
  }
  Path path;
  int s = static_cast<int>(std::min_element(sum.begin(), sum.end()) - sum.begin());
  path.nats = sum[s];
  path.shift.resize(n);
  for (size_t i = n; i-- > 0; s = from[i][s]) path.shift[i] = s;
  return path;
}

std::vector<FrameStep> StepsOf(const Path& path, const std::vector<Instant>& instants, int64_t base_shift) {
  std::vector<FrameStep> steps;
  for (size_t i = 0; i < instants.size(); ++i) {
    const int64_t shift = base_shift + path.shift[i] - kReach;
    if (steps.empty() || steps.back().shift != shift) steps.push_back({instants[i].frame, shift});
  }
  return steps;
}

}  // namespace

Rigid3 BoardTurns::RelativePose(const Rigid3& in_a, const Rigid3& in_b, int k) const {
  if (k == 0) return in_a * geometry::Inverse(in_b);
  Rigid3 turn;
  turn.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0, 2 * kPi * k / num));
  return in_a * turn * geometry::Inverse(in_b);
}

BoardTurns TurnsOf(const std::vector<Board>& boards) {
  BoardTurns turns;
  turns.num = NumNumberings(boards);
  if (turns.num > 1) turns.board_from_middle.translation = CornersInBoard(boards[0]).rowwise().mean();
  return turns;
}

std::vector<FrameStep> FindFrameSteps(const BoardPoses& a, const BoardPoses& b, int64_t base_shift, const BoardTurns& turns) {
  const std::vector<Instant> instants = InstantsOf(a, b, base_shift);
  if (instants.size() < kMinFrames) return {};
  std::vector<Distances> all;
  double sigma = kNone;
  for (const Rigid3& candidate : Candidates(instants, turns)) {
    all.push_back(DistancesUnder(candidate, instants));
    sigma = std::min(sigma, LeastMedian(all.back()));
  }
  sigma = std::max(kNoiseFloor, sigma);
  Path best;
  double constant = kNone;
  for (const Distances& distances : all) {
    constant = std::min(constant, ConstantNats(distances, sigma));
    Path path = CheapestPath(distances, sigma);
    if (path.nats < best.nats) best = std::move(path);
  }
  if (!(constant - best.nats >= kNeededNats)) return {};
  const std::vector<FrameStep> steps = StepsOf(best, instants, base_shift);
  return steps.size() > 1 ? steps : std::vector<FrameStep>();
}

}  // namespace mvstudio::calib
