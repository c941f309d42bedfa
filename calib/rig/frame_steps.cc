#include "calib/rig/frame_steps.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/rig/cheapest_path.h"
#include "calib/rig/numbering.h"
#include "core/statistics.h"
#include "core/units.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr size_t kMaxFrames = 120, kCandidatesPerShift = 12, kMostCandidates = 160;
constexpr size_t kMinFrames = 12;
constexpr double kChangeNats = 8, kNeededNats = 15, kMissingNats = 2;
constexpr double kNoiseFloor = 0.003;  // of the board's distance
constexpr double kNone = std::numeric_limits<double>::infinity();

/// A frame of b and the poses that a has at each shift; null where it has none.
struct TimeStep {
  int64_t frame = 0;
  const Rigid3* b_from_board = nullptr;
  std::vector<const Rigid3*> a_from_board;
};

std::vector<TimeStep> TimeStepsOf(const BoardPoses& a, const BoardPoses& b, int64_t base_shift, int reach) {
  std::vector<TimeStep> all;
  for (const auto& [key, pose] : b) {
    TimeStep time_step{key.first, &pose, {}};
    bool any = false;
    for (int64_t shift = base_shift - reach; shift <= base_shift + reach; ++shift) {
      const auto found = a.find({key.first + shift, key.second});
      time_step.a_from_board.push_back(found == a.end() ? nullptr : &found->second);
      any |= found != a.end();
    }
    if (any) all.push_back(std::move(time_step));
  }
  return all;
}

std::vector<TimeStep> ThinnedTimeSteps(const std::vector<TimeStep>& all) {
  if (all.size() <= kMaxFrames) return all;
  std::vector<TimeStep> thin;
  for (size_t i = 0; i < kMaxFrames; ++i) thin.push_back(all[i * all.size() / kMaxFrames]);
  return thin;
}

double DistanceUnder(const Rigid3& a_from_b, const Rigid3& b_from_board, const Rigid3& a_from_board) {
  return (a_from_b * b_from_board.translation - a_from_board.translation).norm() / a_from_board.translation.norm();
}

/// Distance between the board and its transferred place over its distance; kNone where a has no pose. A row a shift.
Eigen::MatrixXd DistancesUnder(const Rigid3& a_from_b, const std::vector<TimeStep>& time_steps) {
  const auto shifts = static_cast<Eigen::Index>(time_steps.front().a_from_board.size());
  Eigen::MatrixXd distances(shifts, static_cast<Eigen::Index>(time_steps.size()));
  for (Eigen::Index i = 0; i < distances.cols(); ++i) {
    const TimeStep& time_step = time_steps[static_cast<size_t>(i)];
    for (Eigen::Index s = 0; s < shifts; ++s) {
      const Rigid3* const a = time_step.a_from_board[static_cast<size_t>(s)];
      distances(s, i) = a ? DistanceUnder(a_from_b, *time_step.b_from_board, *a) : kNone;
    }
  }
  return distances;
}

/// A relative pose that one frame gives at one shift, and how badly the frames agree with it at that shift.
struct StepCandidate {
  Rigid3 a_from_b;
  double nats = 0;
};

void AddCandidates(const std::vector<TimeStep>& time_steps, size_t s, const BoardTurns& turns,
                   std::vector<StepCandidate>* all) {
  constexpr double kRoughly = 0.01;
  std::vector<const TimeStep*> with;
  for (const TimeStep& time_step : time_steps) {
    if (time_step.a_from_board[s]) with.push_back(&time_step);
  }
  const size_t n = std::min(kCandidatesPerShift, with.size());
  const auto missing = static_cast<double>(time_steps.size() - with.size());
  for (size_t k = 0; k < n; ++k) {
    const TimeStep& one = *with[k * with.size() / n];
    for (int turn = 0; turn < turns.num; ++turn) {
      StepCandidate candidate{turns.RelativePose(*one.a_from_board[s], *one.b_from_board, turn), kMissingNats * missing};
      for (const TimeStep* i : with)
        candidate.nats += RobustNats(DistanceUnder(candidate.a_from_b, *i->b_from_board, *i->a_from_board[s]), kRoughly);
      all->push_back(candidate);
    }
  }
}

/// The likeliest ones where there are many.
std::vector<StepCandidate> StepCandidates(const std::vector<TimeStep>& time_steps, const BoardTurns& turns) {
  std::vector<StepCandidate> all;
  for (size_t s = 0; s < time_steps.front().a_from_board.size(); ++s) AddCandidates(time_steps, s, turns, &all);
  const size_t most = kMostCandidates * static_cast<size_t>(turns.num);
  if (all.size() <= most) return all;
  std::stable_sort(all.begin(), all.end(), [](const StepCandidate& x, const StepCandidate& y) { return x.nats < y.nats; });
  all.resize(most);
  return all;
}

/// Median over the frames of the least distance.
double LeastMedian(const Eigen::MatrixXd& distances) {
  std::vector<double> least;
  for (const auto& column : distances.colwise()) least.push_back(column.minCoeff());
  return UpperMedian(std::move(least));
}

Eigen::MatrixXd NatsOf(const Eigen::MatrixXd& distances, double sigma) {
  return distances.unaryExpr([&](double d) { return d == kNone ? kMissingNats : RobustNats(d, sigma); });
}

/// How far a change before moment `i` may move towards `step` (-1 or 1) at a cost that noise explains.
size_t SureEdge(const Eigen::MatrixXd& nats, const std::vector<int>& state, size_t i, int step) {
  constexpr double kSureNats = 3;
  const int before = state[i - 1], after = state[i];
  const size_t end = step < 0 ? 0 : state.size();
  double cost = 0;
  for (size_t at = i; at != end; at = step < 0 ? at - 1 : at + 1) {
    const size_t moment = step < 0 ? at - 1 : at;
    if (state[moment] != (step < 0 ? before : after)) return at;
    const auto column = static_cast<Eigen::Index>(moment);
    cost += step * (nats(before, column) - nats(after, column));
    if (cost > kSureNats) return at;
  }
  return end;
}

void CountAgreeing(const Eigen::MatrixXd& distances, double sigma, const std::vector<TimeStep>& time_steps,
                   const std::vector<int>& state, std::vector<FrameStep>* steps) {
  constexpr double kAgree = 4;  // standard deviations
  for (size_t k = 0; k < steps->size(); ++k) {
    FrameStep& step = (*steps)[k];
    const int64_t end = k + 1 < steps->size() ? (*steps)[k + 1].last_before + 1 : std::numeric_limits<int64_t>::max();
    for (size_t i = 0; i < time_steps.size(); ++i) {
      if (time_steps[i].frame < step.frame || time_steps[i].frame >= end) continue;
      ++step.num_frames;
      step.num_agreeing += distances(state[i], static_cast<Eigen::Index>(i)) < kAgree * sigma;
    }
  }
}

FrameSteps StepsOf(const CheapestPath& path, const Eigen::MatrixXd& distances, double sigma,
                   const std::vector<TimeStep>& time_steps, int64_t first_shift) {
  const Eigen::MatrixXd nats = NatsOf(distances, sigma);
  FrameSteps found;
  std::vector<double> kept;
  for (size_t i = 0; i < time_steps.size(); ++i) {
    kept.push_back(distances(path.state[i], static_cast<Eigen::Index>(i)));
    if (i > 0 && path.state[i] == path.state[i - 1]) continue;
    FrameStep step{time_steps[i].frame, first_shift + path.state[i], time_steps[i].frame};
    if (i > 0) {
      const size_t low = SureEdge(nats, path.state, i, -1), high = SureEdge(nats, path.state, i, 1);
      step.last_before = time_steps[low > 0 ? low - 1 : 0].frame;
      step.frame = time_steps[std::min(high, time_steps.size() - 1)].frame;
    }
    found.steps.push_back(step);
  }
  found.most = UpperQuantile(std::move(kept), 0.9);
  CountAgreeing(distances, sigma, time_steps, path.state, &found.steps);
  return found;
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

bool FrameSteps::Supported() const {
  constexpr int kLeast = 6;
  constexpr double kShare = 0.8;
  return !steps.empty() && std::all_of(steps.begin(), steps.end(), [&](const FrameStep& step) {
    return step.num_agreeing >= kLeast && step.num_agreeing >= kShare * step.num_frames;
  });
}

FrameSteps FindFrameSteps(const BoardPoses& a, const BoardPoses& b, int64_t base_shift, const BoardTurns& turns, int reach) {
  const std::vector<TimeStep> all = TimeStepsOf(a, b, base_shift, reach);
  if (all.size() < kMinFrames) return {};
  const std::vector<TimeStep> time_steps = ThinnedTimeSteps(all);
  std::vector<std::pair<Rigid3, Eigen::MatrixXd>> trials;  // a_from_b and the distances under it
  double sigma = kNone;
  for (const StepCandidate& candidate : StepCandidates(time_steps, turns)) {
    trials.emplace_back(candidate.a_from_b, DistancesUnder(candidate.a_from_b, time_steps));
    sigma = std::min(sigma, LeastMedian(trials.back().second));
  }
  sigma = std::max(kNoiseFloor, sigma);
  double constant = kNone, least = kNone;
  Rigid3 best;
  for (const auto& [a_from_b, distances] : trials) {
    const Eigen::MatrixXd nats = NatsOf(distances, sigma);
    constant = std::min(constant, nats.row(reach).sum());
    const double cost = FindCheapestPath(nats, kChangeNats).nats;
    if (cost < least) least = cost, best = a_from_b;
  }
  if (!(constant - least >= kNeededNats)) return {};
  const Eigen::MatrixXd distances = DistancesUnder(best, all);
  FrameSteps found =
      StepsOf(FindCheapestPath(NatsOf(distances, sigma), kChangeNats), distances, sigma, all, base_shift - reach);
  return found.steps.size() > 1 ? found : FrameSteps();
}

}  // namespace mvstudio::calib
