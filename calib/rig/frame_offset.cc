#include "calib/rig/frame_offset.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <queue>
#include <set>
#include <tuple>

#include "calib/rig/shift_spread.h"
#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr double kStill = 0.02;       // unrelated frames that agree this well: the board is almost static
constexpr double kClearlyOff = 0.05;  // a spread below this is no reason to refuse
constexpr double kBetterThanGiven = 1.35;
constexpr double kBetterThanOthers = 2;
constexpr double kMuchBetter = 0.5;

using Poses = BoardPoses;

/// Median spread of the shifts that are not next to `best`.
double OtherSpread(const std::vector<ShiftSpread>& scan, int64_t best) {
  std::vector<double> others;
  for (const ShiftSpread& s : scan) {
    if (std::abs(s.shift - best) > 2) others.push_back(s.spread);
  }
  return others.size() < 3 ? NAN : UpperMedian(std::move(others));
}

/// A pair with what every shift gives.
struct Curve {
  FramePair pair;
  std::map<int64_t, ShiftSpread> spreads;

  bool sharp() const { return pair.best_spread * kBetterThanOthers < pair.other_spread && pair.other_spread > kStill; }
  double most() const { return spreads.at(pair.shift).most; }
  /// At its best shift, nine of ten frames agree.
  bool fits() const { return most() * kBetterThanOthers < pair.other_spread && pair.other_spread > kStill; }
  /// At a shift that was not measured: as unrelated frames.
  double At(int64_t shift) const {
    const auto found = spreads.find(shift);
    return std::max(1e-6, found == spreads.end() ? pair.other_spread : found->second.spread);
  }
};

std::optional<Curve> MeasureCurve(const Poses& a, const Poses& b, RelativePoses relative, const FrameOffsetOptions& options) {
  const std::vector<ShiftSpread> scan = ScanShifts(a, b, relative, options);
  if (scan.empty()) return std::nullopt;
  Curve curve;
  curve.pair.moved = relative == RelativePoses::kSeveral;
  curve.pair.best_spread = INFINITY;
  for (const ShiftSpread& s : scan) {
    curve.spreads[s.shift] = s;
    if (s.spread < curve.pair.best_spread) curve.pair.best_spread = s.spread, curve.pair.shift = s.shift;
  }
  curve.pair.other_spread = OtherSpread(scan, curve.pair.shift);
  curve.pair.given_spread = curve.spreads.count(0) ? curve.spreads[0].spread : INFINITY;
  return curve;
}

/// With one relative pose; with several where that makes nine of ten frames agree far better: a small motion can look like
/// another shift.
std::optional<Curve> MeasurePair(const std::vector<Poses>& poses, int a, int b, const FrameOffsetOptions& options) {
  const Poses &in_a = poses[static_cast<size_t>(a)], &in_b = poses[static_cast<size_t>(b)];
  auto curve = MeasureCurve(in_a, in_b, RelativePoses::kOne, options);
  if (!curve) return std::nullopt;
  if (!curve->fits() || curve->most() > kStill) {
    const auto moved = MeasureCurve(in_a, in_b, RelativePoses::kSeveral, options);
    if (moved->fits() && moved->most() < kMuchBetter * curve->most()) curve = moved;
  }
  curve->pair.a = a, curve->pair.b = b;
  return curve;
}

/// Pairs worth comparing: for each camera the three others with which it shares most frames, and a spanning tree.
std::vector<std::pair<int, int>> ChoosePairs(const std::vector<Poses>& poses) {
  struct Shared {
    int count, a, b;
  };
  const auto n = static_cast<int>(poses.size());
  std::vector<Shared> shared;
  for (int a = 0; a < n; ++a) {
    for (int b = a + 1; b < n; ++b) {
      int count = 0;
      for (const auto& [key, pose] : poses[static_cast<size_t>(b)]) count += poses[static_cast<size_t>(a)].count(key) > 0;
      shared.push_back({count, a, b});
    }
  }
  std::stable_sort(shared.begin(), shared.end(), [](const Shared& x, const Shared& y) { return x.count > y.count; });
  std::vector<int> component(poses.size()), degree(poses.size(), 0);
  for (int c = 0; c < n; ++c) component[static_cast<size_t>(c)] = c;
  std::vector<std::pair<int, int>> pairs;
  for (const Shared& s : shared) {
    const int from = component[static_cast<size_t>(s.b)], to = component[static_cast<size_t>(s.a)];
    int &degree_a = degree[static_cast<size_t>(s.a)], &degree_b = degree[static_cast<size_t>(s.b)];
    if (from == to && degree_a >= 3 && degree_b >= 3) continue;
    pairs.emplace_back(s.a, s.b);
    ++degree_a, ++degree_b;
    std::replace(component.begin(), component.end(), from, to);
  }
  return pairs;
}

using Shifts = std::vector<int64_t>;

/// Sum of the logarithms of the spreads that these shifts give.
double Energy(const std::vector<Curve>& curves, const Shifts& shift) {
  double sum = 0;
  for (const Curve& curve : curves) {
    if (curve.sharp())
      sum += std::log(curve.At(shift[static_cast<size_t>(curve.pair.b)] - shift[static_cast<size_t>(curve.pair.a)]));
  }
  return sum;
}

/// Shifts that every pair would like best, along the pairs from camera to camera.
Shifts PairwiseBest(const std::vector<Curve>& curves, size_t num_cameras) {
  Shifts shift(num_cameras, 0);
  std::vector<bool> known(num_cameras, false);
  for (size_t start = 0; start < num_cameras; ++start) {
    if (known[start]) continue;
    std::queue<size_t> todo({start});
    known[start] = true;
    while (!todo.empty()) {
      const size_t camera = todo.front();
      todo.pop();
      for (const Curve& curve : curves) {
        const auto a = static_cast<size_t>(curve.pair.a), b = static_cast<size_t>(curve.pair.b);
        if (!curve.sharp() || (a != camera && b != camera) || known[a == camera ? b : a]) continue;
        const size_t other = a == camera ? b : a;
        shift[other] = shift[camera] + (a == camera ? curve.pair.shift : -curve.pair.shift);
        known[other] = true;
        todo.push(other);
      }
    }
  }
  return shift;
}

/// Moves one camera after the other to its best shift while that helps.
Shifts Descend(const std::vector<Curve>& curves, Shifts shift, int64_t max_shift) {
  bool moved = true;
  for (int round = 0; moved && round < 20; ++round) {
    moved = false;
    for (size_t c = 0; c < shift.size(); ++c) {
      const int64_t before = shift[c];
      int64_t best = before;
      double least = Energy(curves, shift);
      for (int64_t s = before - max_shift; s <= before + max_shift; ++s) {
        shift[c] = s;
        const double energy = Energy(curves, shift);
        if (energy < least - 1e-9) least = energy, best = s;
      }
      shift[c] = best;
      moved |= best != before;
    }
  }
  return shift;
}

/// Cameras linked by pairs with a sharp minimum have the same number.
std::vector<int> Groups(const std::vector<Curve>& curves, size_t num_cameras) {
  std::vector<int> group(num_cameras);
  for (size_t c = 0; c < num_cameras; ++c) group[c] = static_cast<int>(c);
  for (const Curve& curve : curves) {
    if (!curve.sharp()) continue;
    const int from = group[static_cast<size_t>(curve.pair.b)], to = group[static_cast<size_t>(curve.pair.a)];
    std::replace(group.begin(), group.end(), from, to);
  }
  return group;
}

/// Makes the most common shift of every group 0.
void Centre(const std::vector<int>& group, Shifts* shift) {
  for (size_t g = 0; g < group.size(); ++g) {
    std::map<int64_t, int> count;
    for (size_t c = 0; c < group.size(); ++c) {
      if (group[c] == static_cast<int>(g)) ++count[(*shift)[c]];
    }
    int64_t common = 0;
    int most = 0;
    for (const auto& [value, times] : count) {
      if (times > most || (times == most && std::abs(value) < std::abs(common))) most = times, common = value;
    }
    for (size_t c = 0; c < group.size(); ++c) (*shift)[c] -= group[c] == static_cast<int>(g) ? common : 0;
  }
}

/// Keeps a camera's frame numbers when shifting them gains almost nothing.
void DropIdleShifts(const std::vector<Curve>& curves, Shifts* shift) {
  for (size_t c = 0; c < shift->size(); ++c) {
    Shifts without = *shift;
    without[c] = 0;
    int pairs = 0;
    for (const Curve& curve : curves)
      pairs += curve.sharp() && (curve.pair.a == static_cast<int>(c) || curve.pair.b == static_cast<int>(c));
    if (Energy(curves, without) - Energy(curves, *shift) <= pairs * std::log(kBetterThanGiven)) *shift = without;
  }
}

/// The shifts with the least energy; none where they do not clearly pay for the pairs that they change.
Shifts SolveShifts(const std::vector<Curve>& curves, size_t num_cameras, int64_t max_shift) {
  const Shifts zero(num_cameras, 0);
  const Shifts from_zero = Descend(curves, zero, max_shift),
               from_pairs = Descend(curves, PairwiseBest(curves, num_cameras), max_shift);
  Shifts best = Energy(curves, from_pairs) < Energy(curves, from_zero) ? from_pairs : from_zero;
  Centre(Groups(curves, num_cameras), &best);
  DropIdleShifts(curves, &best);
  int changed = 0;
  for (const Curve& curve : curves)
    changed += curve.sharp() && best[static_cast<size_t>(curve.pair.a)] != best[static_cast<size_t>(curve.pair.b)];
  return Energy(curves, zero) - Energy(curves, best) > changed * std::log(kBetterThanGiven) ? best : zero;
}

FramePair Judge(const Curve& curve, const Shifts& shift) {
  FramePair pair = curve.pair;
  pair.shift = shift[static_cast<size_t>(pair.b)] - shift[static_cast<size_t>(pair.a)];
  pair.best_spread = curve.At(pair.shift);
  const auto found = curve.spreads.find(pair.shift);
  pair.num_shared = found == curve.spreads.end() ? 0 : found->second.num_shared;
  const double most = found == curve.spreads.end() ? INFINITY : found->second.most;
  const bool fits = most * kBetterThanOthers < pair.other_spread;
  if (fits && pair.other_spread > kStill) {
    pair.kind = pair.shift == 0 ? FramePair::Kind::kConsistent : FramePair::Kind::kShifted;
  } else if (!fits && most > kClearlyOff && std::isfinite(pair.other_spread)) {
    pair.kind = FramePair::Kind::kInconsistent;
  }
  pair.most = most;
  return pair;
}

/// Steps of the shift make the pair inconsistent, unless a camera that moved explains its frames better.
void AddSteps(const std::vector<Poses>& poses, const BoardTurns& turns, FramePair* pair) {
  const Poses &a = poses[static_cast<size_t>(pair->a)], &b = poses[static_cast<size_t>(pair->b)];
  FrameSteps steps = FindFrameSteps(a, b, pair->shift, turns, kNearShifts);
  if (!steps.Supported() && (pair->kind == FramePair::Kind::kInconsistent || !steps.steps.empty())) {
    FrameSteps far = FindFrameSteps(a, b, pair->shift, turns, kFarShifts);
    if (far.Supported()) steps = std::move(far);
  }
  if (steps.steps.empty() || (pair->moved && pair->most < steps.most)) return;
  pair->kind = FramePair::Kind::kInconsistent;
  pair->moved = false;
  pair->steps_supported = steps.Supported();
  pair->steps = std::move(steps.steps);
}

/// " (from frame 17 on by 1, from frame 34 on by 2)"; empty when the steps are not known.
std::string StepsText(const std::vector<FrameStep>& steps) {
  std::string text;
  for (size_t i = 1; i < steps.size(); ++i) {
    text += (text.empty() ? " (from frame " : ", from frame ") + std::to_string(steps[i].frame) + " on by " +
            std::to_string(steps[i].shift - steps[0].shift);
  }
  return text.empty() ? text : text + ")";
}

void Describe(const std::vector<std::string>& names, FrameOffsets* out) {
  std::string list;
  if (out->kind == FrameOffsets::Kind::kShifted) {
    for (size_t c = 0; c < names.size(); ++c) {
      if (out->shift[c] == 0) continue;
      list += (list.empty() ? "" : ", ") + names[c] + " by " + std::to_string(out->shift[c]);
    }
    out->text =
        "frames with the same number were not taken at the same time; the boards agree when these are added to the frame "
        "numbers: " +
        list;
    out->hint = "shift the frame numbers, or pair the frames by their time stamps";
  } else if (out->kind == FrameOffsets::Kind::kInconsistent) {
    std::set<std::string> pairs;
    for (const FramePair& pair : out->pairs) {
      if (pair.kind == FramePair::Kind::kInconsistent)
        pairs.insert(names[static_cast<size_t>(pair.a)] + " and " + names[static_cast<size_t>(pair.b)] + StepsText(pair.steps));
    }
    for (const std::string& pair : pairs) list += (list.empty() ? ": " : ", ") + pair;
    out->text = "board positions disagree between cameras at equal frame numbers, and no constant offset fixes it" + list;
    out->hint = "pair frames by time (caliscope: sync_index), not by their position in the file; look for dropped frames";
  }
}

FrameOffsets::Kind Conclude(const FrameOffsets& offsets) {
  bool decided = false, inconsistent = false;
  for (const FramePair& pair : offsets.pairs) {
    decided |= pair.kind == FramePair::Kind::kConsistent || pair.kind == FramePair::Kind::kShifted;
    inconsistent |= pair.kind == FramePair::Kind::kInconsistent;
  }
  if (inconsistent) return FrameOffsets::Kind::kInconsistent;
  if (!decided) return FrameOffsets::Kind::kUndecided;
  const bool any = std::any_of(offsets.shift.begin(), offsets.shift.end(), [](int64_t s) { return s != 0; });
  return any ? FrameOffsets::Kind::kShifted : FrameOffsets::Kind::kConsistent;
}

}  // namespace

FrameOffsets FindFrameOffsets(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board,
                              const std::vector<int64_t>& frames, const std::vector<std::string>& camera_names,
                              const FrameOffsetOptions& options) {
  MVS_CHECK(views.size() == cam_from_board.size(), views.size() << " views, " << cam_from_board.size() << " poses");
  std::vector<Poses> poses(camera_names.size());
  for (size_t v = 0; v < views.size(); ++v) {
    const bool used = views[v].weights.size() > 0 && views[v].weights.maxCoeff() > 0;
    if (!used || !cam_from_board[v].translation.allFinite() || !(cam_from_board[v].translation.norm() > 0)) continue;
    poses[static_cast<size_t>(views[v].camera_idx)].insert(
        {{frames[static_cast<size_t>(views[v].frame)], views[v].board}, cam_from_board[v] * options.turns.board_from_middle});
  }
  FrameOffsets out;
  out.shift.assign(camera_names.size(), 0);
  std::vector<Curve> curves;
  for (const auto& [a, b] : ChoosePairs(poses)) {
    if (const auto curve = MeasurePair(poses, a, b, options)) curves.push_back(*curve);
  }
  out.shift = SolveShifts(curves, camera_names.size(), options.max_shift);
  for (const Curve& curve : curves) {
    FramePair pair = Judge(curve, out.shift);
    AddSteps(poses, options.turns, &pair);
    out.pairs.push_back(pair);
  }
  out.kind = Conclude(out);
  if (out.kind != FrameOffsets::Kind::kShifted) std::fill(out.shift.begin(), out.shift.end(), 0);
  Describe(camera_names, &out);
  return out;
}

void Reconsider(const std::vector<View>& views, const std::vector<Eigen::VectorXd>& prior,
                const std::vector<Eigen::Matrix2Xd>& residuals_px, const std::vector<std::string>& camera_names,
                const std::vector<bool>& explained, FrameOffsets* offsets) {
  if (offsets->kind != FrameOffsets::Kind::kInconsistent) return;
  constexpr double kMostLost = 0.05, kLostPx = 0.25;
  std::map<std::tuple<int, int, int>, bool> lost;  // by camera, frame and board
  for (size_t v = 0; v < views.size(); ++v) {
    Eigen::Index given = 0, kept = 0;
    for (Eigen::Index i = 0; i < prior[v].size(); ++i) {
      given += prior[v][i] > 0;
      kept += prior[v][i] > 0 && (views[v].weights[i] > 0 || residuals_px[v].col(i).norm() < kLostPx);
    }
    if (given > 0) lost[{views[v].camera_idx, views[v].frame, views[v].board}] = 2 * kept < given;
  }
  for (FramePair& pair : offsets->pairs) {
    const bool both = explained[static_cast<size_t>(pair.a)] && explained[static_cast<size_t>(pair.b)];
    if (pair.kind != FramePair::Kind::kInconsistent || !both) continue;
    int shared = 0, broken = 0;
    for (const auto& [view, lost_in_a] : lost) {
      const auto& [camera, frame, board] = view;
      const auto other = camera == pair.a ? lost.find({pair.b, frame, board}) : lost.end();
      if (other == lost.end()) continue;
      ++shared, broken += lost_in_a || other->second;
    }
    if (broken > kMostLost * shared) continue;
    pair.kind = FramePair::Kind::kConsistent;
    pair.steps.clear();
  }
  offsets->kind = Conclude(*offsets);
  offsets->text = offsets->hint = "";
  Describe(camera_names, offsets);
}

void ApplyFrameOffsets(const FrameOffsets& offsets, std::vector<Detection>* detections) {
  for (Detection& detection : *detections) detection.frame_idx += offsets.shift[static_cast<size_t>(detection.camera_idx)];
}

}  // namespace mvstudio::calib
