#include "dataset/markers/gait_events.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/fields.h"
#include "core/format.h"
#include "core/statistics.h"
#include "core/text/shortest_text.h"
#include "dataset/markers/filter.h"
#include "dataset/markers/posture_angles.h"

namespace mvstudio::markers {
namespace {

using Eigen::Vector3d;

constexpr ChoiceWords<GaitEventKind, 2> kKindWords = {
    {{GaitEventKind::kHeelStrike, "heel_strike"}, {GaitEventKind::kToeOff, "toe_off"}}};
constexpr ChoiceWords<GaitConfidence, 3> kConfidenceWords = {
    {{GaitConfidence::kHigh, "high"}, {GaitConfidence::kMedium, "medium"}, {GaitConfidence::kLow, "low"}}};

using Series = std::vector<double>;
const double kMissing = std::nan("");

/// Each run of values smoothed, 0.03 s.
Series Smooth(const Series& values, double rate_hz) {
  constexpr double kSigmaS = 0.03;
  Series smooth(values.size(), kMissing);
  for (size_t begin = 0; begin < values.size();) {
    size_t end = begin;
    while (end < values.size() && std::isfinite(values[end])) ++end;
    if (end > begin) {
      const Series run = GaussianMean(
          Series(values.begin() + static_cast<std::ptrdiff_t>(begin), values.begin() + static_cast<std::ptrdiff_t>(end)),
          kSigmaS * rate_hz);
      std::copy(run.begin(), run.end(), smooth.begin() + static_cast<std::ptrdiff_t>(begin));
    }
    begin = end + 1;
  }
  return smooth;
}

/// Whether the value is the largest within `reach` frames, with values on both sides; `sign` -1: the smallest.
bool IsExtremum(const Series& values, int at, int reach, double sign) {
  const int last = static_cast<int>(values.size()) - 1;
  if (at - 1 < 0 || at + 1 > last) return false;
  for (int k = std::max(0, at - reach); k <= std::min(last, at + reach); ++k) {
    if (!std::isfinite(values[k])) {
      if (std::abs(k - at) <= 1) return false;
      continue;
    }
    if (sign * values[k] > sign * values[at] || (k < at && values[k] == values[at])) return false;
  }
  return true;
}

std::vector<int> Extrema(const Series& values, double rate_hz, double sign) {
  constexpr double kReachS = 0.25;
  const int reach = std::max(1, static_cast<int>(std::lround(kReachS * rate_hz)));
  std::vector<int> found;
  for (int f = 0; f < static_cast<int>(values.size()); ++f) {
    if (std::isfinite(values[f]) && IsExtremum(values, f, reach, sign)) found.push_back(f);
  }
  return found;
}

/// What feet do, against the pelvis.
struct Gait {
  Series heel[2], toe[2];  ///< metres before the pelvis; left, right
  Series lift[2];          ///< vertical velocity of the foot's middle, m per frame
  Series ahead;            ///< of the pelvis on its way, metres along where it faces, summed
  double leg_m = 0;
};

class Feet {
 public:
  explicit Feet(const MarkerTake& take) : take_(take), roles_(internal::RolesOf(take.names)) {
    for (const int side : {0, 1}) {
      const int ankle = roles_[internal::kLAnkle + side];
      heel_[side] = roles_[internal::kLHeel + side], toe_[side] = roles_[internal::kLToe + side];
      if (heel_[side] < 0) heel_[side] = ankle, heels_ = false;
      if (toe_[side] < 0) toe_[side] = ankle, toes_ = false;
    }
  }

  bool HasAll() const { return roles_[internal::kLHip] >= 0 && roles_[internal::kRHip] >= 0 && heel_[0] >= 0 && heel_[1] >= 0; }
  std::string Note() const {
    if (heels_ && toes_) return "";
    return std::string("there are no ") +
           (heels_  ? "toes"
            : toes_ ? "heels"
                    : "heels and toes") +
           ": ankles stand in for them, and events may come some hundredths of a second off";
  }

  Gait Read() const {
    Gait gait;
    const int frames = take_.num_frames();
    std::vector<Vector3d> facing = Facing();
    gait.ahead.assign(static_cast<size_t>(frames), kMissing);
    for (Series* s : {&gait.heel[0], &gait.heel[1], &gait.toe[0], &gait.toe[1], &gait.lift[0], &gait.lift[1]})
      s->assign(static_cast<size_t>(frames), kMissing);
    std::vector<double> legs;
    double way = 0;
    Vector3d last = Vector3d::Constant(kMissing);
    for (int f = 0; f < frames; ++f) {
      const Vector3d pelvis = Pelvis(f), forward = facing[static_cast<size_t>(f)];
      const double step = forward.dot(pelvis - last);
      if (std::isfinite(step)) way += step;
      if (pelvis.allFinite()) last = pelvis;
      gait.ahead[static_cast<size_t>(f)] = pelvis.allFinite() && forward.allFinite() ? way : kMissing;
      for (const int side : {0, 1}) {
        gait.heel[side][f] = forward.dot(At(heel_[side], f) - pelvis);
        gait.toe[side][f] = forward.dot(At(toe_[side], f) - pelvis);
        gait.lift[side][f] = (At(heel_[side], f).z() + At(toe_[side], f).z()) / 2;
        const double leg = (At(roles_[internal::kLHip + side], f) - At(heel_[side], f)).norm();
        if (std::isfinite(leg)) legs.push_back(leg);
      }
    }
    gait.leg_m = UpperMedian(std::move(legs), 0.0);
    for (const int side : {0, 1}) {
      for (Series* s : {&gait.heel[side], &gait.toe[side]}) *s = Smooth(*s, take_.rate_hz);
      const Series height = Smooth(gait.lift[side], take_.rate_hz);
      for (int f = 0; f < frames; ++f)
        gait.lift[side][f] = f > 0 && f + 1 < frames ? (height[f + 1] - height[f - 1]) / 2 : kMissing;
    }
    return gait;
  }

 private:
  Vector3d At(int marker, int f) const {
    if (marker < 0 || take_.source[take_.Index(f, marker)] == Source::kMissing) return Vector3d::Constant(kMissing);
    return take_.x_in_world[take_.Index(f, marker)];
  }
  Vector3d Pelvis(int f) const { return (At(roles_[internal::kLHip], f) + At(roles_[internal::kRHip], f)) / 2; }

  /// Where the hips face, level, averaged over half a second.
  std::vector<Vector3d> Facing() const {
    constexpr double kHalfS = 0.25;
    const int frames = take_.num_frames(), half = static_cast<int>(std::lround(kHalfS * take_.rate_hz));
    std::vector<Vector3d> single, mean;
    for (int f = 0; f < frames; ++f) {
      const Vector3d right = At(roles_[internal::kRHip], f) - At(roles_[internal::kLHip], f);
      single.push_back(Vector3d::UnitZ().cross(right));
    }
    for (int f = 0; f < frames; ++f) {
      Vector3d sum = Vector3d::Zero();
      for (int k = std::max(0, f - half); k <= std::min(frames - 1, f + half); ++k) {
        if (single[static_cast<size_t>(k)].allFinite()) sum += single[static_cast<size_t>(k)];
      }
      mean.push_back(sum.norm() > 0 ? Vector3d(sum.normalized()) : Vector3d::Constant(kMissing));
    }
    return mean;
  }

  const MarkerTake& take_;
  std::vector<int> roles_;
  int heel_[2], toe_[2];
  bool heels_ = true, toes_ = true;
};

struct Strike {
  int frame = 0, side = 0;
};

/// Heel strikes that alternate; stretches of three at least.
std::vector<std::vector<Strike>> Walks(const Gait& gait, double rate_hz) {
  constexpr double kLeastStepS = 0.2, kMostStepS = 1.5, kLeastStep = 0.2, kMostUneven = 1.8;
  const size_t least = 3;
  std::vector<Strike> strikes;
  for (const int side : {0, 1}) {
    for (const int f : Extrema(gait.heel[side], rate_hz, 1)) {
      if (gait.heel[side][f] - gait.heel[1 - side][f] >= kLeastStep * gait.leg_m) strikes.push_back({f, side});
    }
  }
  std::sort(strikes.begin(), strikes.end(), [](const Strike& a, const Strike& b) { return a.frame < b.frame; });
  std::vector<std::vector<Strike>> walks(1);
  for (const Strike& strike : strikes) {
    std::vector<Strike>& walk = walks.back();
    if (!walk.empty()) {
      const double step_s = (strike.frame - walk.back().frame) / rate_hz;
      const double before_s = walk.size() > 1 ? (walk.back().frame - walk[walk.size() - 2].frame) / rate_hz : step_s;
      const bool uneven = std::max(step_s, before_s) > kMostUneven * std::min(step_s, before_s);
      if (walk.back().side == strike.side || step_s < kLeastStepS || step_s > kMostStepS || uneven) {
        walks.push_back({strike});
        continue;
      }
    }
    walk.push_back(strike);
  }
  walks.erase(std::remove_if(walks.begin(), walks.end(), [=](const auto& walk) { return walk.size() < least; }), walks.end());
  return walks;
}

/// The second opinion on an event.
void Compare(const Series& lift, double rate_hz, int first_frame, GaitEvent* event) {
  constexpr double kReachS = 0.15, kHighS = 0.05, kMediumS = 0.1;
  const int reach = static_cast<int>(std::lround(kReachS * rate_hz)), at = event->frame - first_frame;
  const double sign = event->kind == GaitEventKind::kHeelStrike ? -1 : 1;
  int best = -1;
  for (int f = std::max(1, at - reach); f <= std::min(static_cast<int>(lift.size()) - 2, at + reach); ++f) {
    if (!std::isfinite(lift[f]) || !IsExtremum(lift, f, 1, sign)) continue;
    if (best < 0 || sign * lift[f] > sign * lift[best]) best = f;
  }
  if (best < 0) return;
  event->velocity_frame = best + first_frame, event->has_velocity_frame = true;
  const double apart_s = std::abs(best - at) / rate_hz;
  constexpr double kRounding = 1e-9;
  event->confidence = apart_s <= kHighS + kRounding     ? GaitConfidence::kHigh
                      : apart_s <= kMediumS + kRounding ? GaitConfidence::kMedium
                                                        : GaitConfidence::kLow;
}

/// False, and nothing is added, where the second method contradicts most of its events: dances have such heels, too.
bool AddWalk(const Gait& gait, const std::vector<Strike>& walk, const MarkerTake& take, GaitReport* report) {
  std::vector<GaitEvent> events;
  const auto add = [&](int f, int side, GaitEventKind kind) {
    GaitEvent event;
    event.frame = take.first_frame + f, event.left = side == 0, event.kind = kind;
    Compare(gait.lift[side], take.rate_hz, take.first_frame, &event);
    events.push_back(event);
  };
  for (const Strike& strike : walk) add(strike.frame, strike.side, GaitEventKind::kHeelStrike);
  constexpr double kBeyondS = 0.75;  // a toe off before the first and after the last strike belongs to their steps
  const int beyond = static_cast<int>(std::lround(kBeyondS * take.rate_hz));
  for (const int side : {0, 1}) {
    for (const int f : Extrema(gait.toe[side], take.rate_hz, -1)) {
      const bool behind = gait.toe[side][f] < gait.toe[1 - side][f];
      if (behind && f >= walk.front().frame - beyond && f <= walk.back().frame + beyond) add(f, side, GaitEventKind::kToeOff);
    }
  }
  const auto low = std::count_if(events.begin(), events.end(),
                                 [](const GaitEvent& event) { return event.confidence == GaitConfidence::kLow; });
  if (2 * static_cast<size_t>(low) > events.size()) return false;
  report->events.insert(report->events.end(), events.begin(), events.end());
  return true;
}

std::string WhyNone(const Gait& gait) {
  double most = 0;
  for (size_t f = 0; f < gait.heel[0].size(); ++f) {
    const double apart = std::abs(gait.heel[0][f] - gait.heel[1][f]);
    if (std::isfinite(apart)) most = std::max(most, apart);
  }
  return Format(
      "the person does not walk: no three heel strikes of alternating sides in even steps of 0.2 to 1.5 s and a fifth of the "
      "leg; one "
      "heel "
      "is at most %.0f %% of the leg before the other",
      gait.leg_m > 0 ? 100 * most / gait.leg_m : 0.0);
}

}  // namespace

std::string_view ToString(GaitEventKind kind) { return WordOf(kKindWords, kind); }
std::string_view ToString(GaitConfidence confidence) { return WordOf(kConfidenceWords, confidence); }

GaitReport FindGaitEvents(const MarkerTake& take, bool has_up) {
  GaitReport report;
  const Feet feet(take);
  if (!has_up) {
    report.why_none = "nothing is up in the world of these joints, so that no direction is level";
    return report;
  }
  if (!feet.HasAll()) {
    report.why_none = "both hips, and heels or ankles of both sides, are needed";
    return report;
  }
  report.note = feet.Note();
  const Gait gait = feet.Read();
  double way_m = 0, seconds = 0;
  int steps = 0;
  for (const std::vector<Strike>& walk : Walks(gait, take.rate_hz)) {
    const double way = gait.ahead[walk.back().frame] - gait.ahead[walk.front().frame];
    const double time = (walk.back().frame - walk.front().frame) / take.rate_hz;
    constexpr double kBackwards = -0.2;
    if (way / time < kBackwards) {
      report.why_none = Format("the person walks backwards (frames %d to %d), where heels do not strike first",
                               take.first_frame + walk.front().frame, take.first_frame + walk.back().frame);
      continue;
    }
    if (!AddWalk(gait, walk, take, &report)) continue;
    way_m += way, seconds += time, steps += static_cast<int>(walk.size()) - 1;
  }
  std::sort(report.events.begin(), report.events.end(), [](const GaitEvent& a, const GaitEvent& b) {
    return std::tuple(a.frame, a.left, a.kind) < std::tuple(b.frame, b.left, b.kind);
  });
  // Walks that follow each other closely share the toe offs between them.
  report.events.erase(std::unique(report.events.begin(), report.events.end(),
                                  [](const GaitEvent& a, const GaitEvent& b) {
                                    return std::tuple(a.frame, a.left, a.kind) == std::tuple(b.frame, b.left, b.kind);
                                  }),
                      report.events.end());
  if (seconds > 0) report.speed_m_s = way_m / seconds, report.cadence_per_min = 60 * steps / seconds;
  if (!report.events.empty())
    report.why_none.clear();
  else if (report.why_none.empty())
    report.why_none = WhyNone(gait);
  return report;
}

std::string GaitCsvText(const GaitReport& report, const MarkerTake& take) {
  std::string text = "frame,time_s,side,event,confidence,velocity_frame\n";
  for (const GaitEvent& event : report.events) {
    text += std::to_string(event.frame) + ",";
    AppendShortestText((event.frame - take.first_frame) / take.rate_hz, &text);
    text += std::string(event.left ? ",left," : ",right,") + std::string(ToString(event.kind)) + "," +
            std::string(ToString(event.confidence)) + ",";
    if (event.has_velocity_frame) text += std::to_string(event.velocity_frame);
    text += "\n";
  }
  return text;
}

}  // namespace mvstudio::markers
