#include "dataset/time/timeline.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.h"
#include "core/statistics.h"
#include "dataset/time/clock_fit.h"

namespace mvstudio::dataset {
namespace {

using internal::ClockFit;
using internal::kNoTick;

constexpr double kMaxTimeSteps = 2e6;
constexpr double kSameRate = 2e-3;    // relative; clocks of the same nominal rate differ by less
constexpr double kTie = 1e-6;         // of a period: a time step halfway between two frames takes the later one
constexpr double kWorstOnLine = 0.4;  // of a period

/// One camera on the way to its timeline.
struct Clock {
  const CameraTimes* times = nullptr;
  ClockFit fit;
  double period_s = 0;  ///< on the common clock
  double origin_s = 0;  ///< common = (own - origin) * rate + shift
  double rate = 1, shift_s = 0;
  bool placed = false;                              ///< on the common clock
  bool on_line = false;                             ///< its time stamps are its line
  std::vector<std::pair<int64_t, size_t>> by_tick;  ///< usable frames: (tick, position), ascending
  std::vector<std::pair<double, size_t>> by_time;   ///< usable frames: (common time, position), ascending

  double Common(double own_s) const { return (own_s - origin_s) * rate + shift_s; }
  double TickTime(double tick) const { return Common(fit.start_s + tick * fit.period_s); }
};

Clock MakeClock(const CameraTimes& times, const TimelineOptions& options) {
  Clock clock;
  clock.times = &times;
  clock.fit = internal::FitClock(times.time_s);
  clock.period_s = clock.fit.period_s;
  clock.on_line = clock.fit.status == ClockStatus::kOk && clock.fit.jitter_s <= options.jitter_limit * clock.fit.period_s &&
                  clock.fit.worst_s <= kWorstOnLine * clock.fit.period_s;
  return clock;
}

void CheckTimes(const std::vector<CameraTimes>& cameras) {
  std::set<std::string> names;
  if (cameras.empty()) throw UsageError("a timeline needs a camera with footage");
  for (const CameraTimes& c : cameras) {
    if (!names.insert(c.camera).second) throw UsageError("camera " + c.camera + " is there twice");
    if (c.frame.size() != c.time_s.size()) throw FormatError(c.source, "", "frames and time stamps differ in number");
  }
}

/// Offset of each camera in frames; NaN: not known.
std::vector<double> KnownOffsets(const std::vector<Clock>& clocks, TimelineClock kind, const SyncFile* sync) {
  std::vector<std::string> names;
  for (const Clock& c : clocks) names.push_back(c.times->camera);
  const bool offsets = kind == TimelineClock::kOffsets && sync;
  return offsets ? OffsetsOf(*sync, names) : std::vector<double>(names.size(), 0.0);
}

size_t Reference(const std::vector<Clock>& clocks, const std::vector<double>& known, const std::string& named, bool must) {
  const auto fits = [&](size_t i) {
    return clocks[i].fit.status == ClockStatus::kOk && clocks[i].fit.period_s > 0 && std::isfinite(known[i]);
  };
  for (size_t i = 0; i < clocks.size(); ++i) {
    if (clocks[i].times->camera != named || (!must && !fits(i))) continue;
    if (fits(i)) return i;
    throw FormatError(clocks[i].times->source, "",
                      "camera " + named + " has no regular time stamps, or no offset: it cannot be the reference");
  }
  if (must) throw UsageError("option 'reference' " + named + ": no such camera has footage in this take");
  for (size_t i = 0; i < clocks.size(); ++i) {
    if (fits(i)) return i;
  }
  throw FormatError(clocks[0].times->source, "", "no camera of the take has regular time stamps to count time steps by");
}

/// Where each camera's own time lies on the reference's.
void PlaceClocks(TimelineClock kind, const SyncFile* sync, const std::vector<double>& known, size_t reference,
                 std::vector<Clock>* clocks) {
  const Clock ref = (*clocks)[reference];
  const double ref_origin = ref.times->origin_s.value_or(ref.fit.start_s);
  const bool offsets = kind == TimelineClock::kOffsets && sync;
  std::vector<std::string> names;
  for (const Clock& c : *clocks) names.push_back(c.times->camera);
  const std::vector<double> rates = offsets ? RatesOf(*sync, names) : std::vector<double>(names.size(), 1);
  const double frame_s = sync && sync->fps ? 1 / *sync->fps : ref.fit.period_s * rates[reference];
  for (size_t i = 0; i < clocks->size(); ++i) {
    Clock& c = (*clocks)[i];
    c.placed = c.fit.status != ClockStatus::kNoTime && std::isfinite(known[i]);
    if (kind == TimelineClock::kCommon) {
      c.origin_s = c.shift_s = 0;
      continue;
    }
    c.origin_s = c.times->origin_s.value_or(c.fit.start_s);
    c.shift_s = ref_origin - (known[i] / rates[i] - known[reference] / rates[reference]) * frame_s;
    if (!offsets) continue;
    for (const SyncedCamera& s : sync->cameras) {
      if (s.name != c.times->camera) continue;
      c.rate = 1 + 1e-6 * s.rate_ppm;
      // Where the file knows of other rates, they are the motion's, whatever rates the videos state.
      if (s.nominal_rate != 1 && c.fit.period_s > 0) c.rate = frame_s / rates[i] / c.fit.period_s;
    }
    c.period_s = c.fit.period_s * c.rate;
  }
}

/// Frames with a time step of their own.
void ListFrames(Clock* c) {
  const CameraTimes& t = *c->times;
  const std::set<int64_t> repeats(t.repeats.begin(), t.repeats.end());
  const std::set<size_t> bad(c->fit.bad.begin(), c->fit.bad.end()), same(c->fit.same.begin(), c->fit.same.end());
  for (size_t k = 0; k < t.frame.size(); ++k) {
    if (repeats.count(t.frame[k]) || same.count(k)) continue;
    if (c->fit.tick[k] != kNoTick) c->by_tick.emplace_back(c->fit.tick[k], k);
    if (!bad.count(k)) c->by_time.emplace_back(c->Common(t.time_s[k]), k);
  }
  std::sort(c->by_time.begin(), c->by_time.end());
}

/// The tick that the clock shows at a common time, between the time stamps around it.
double TickBetween(const Clock& c, double time_s) {
  const auto after = std::lower_bound(c.by_time.begin(), c.by_time.end(), std::pair<double, size_t>{time_s, 0});
  const auto tick = [&](const auto& at) { return static_cast<double>(c.fit.tick[at->second]); };
  const double period = std::max(c.period_s, 1e-12);
  if (after == c.by_time.begin()) return tick(after) - (after->first - time_s) / period;
  const auto before = after - 1;
  if (after == c.by_time.end() || after->first - before->first < 1e-9) return tick(before) + (time_s - before->first) / period;
  return tick(before) + (time_s - before->first) / (after->first - before->first) * (tick(after) - tick(before));
}

/// Position of the frame at a common time; -1: none.
int64_t FrameAt(const Clock& c, double time_s, double step_period_s) {
  if (c.by_time.empty()) return -1;
  if (c.fit.status == ClockStatus::kVariable || c.fit.period_s <= 0) {
    auto near = std::lower_bound(c.by_time.begin(), c.by_time.end(), std::pair<double, size_t>{time_s, 0});
    if (near == c.by_time.end() || (near != c.by_time.begin() && time_s - (near - 1)->first < near->first - time_s)) --near;
    const double most = (0.5 + kTie) * std::max(c.period_s, step_period_s);
    return std::abs(near->first - time_s) <= most ? static_cast<int64_t>(near->second) : -1;
  }
  const double exact = c.on_line ? (time_s - c.TickTime(0)) / c.period_s : TickBetween(c, time_s);
  const auto tick = static_cast<int64_t>(std::floor(std::clamp(exact, -1e15, 1e15) + 0.5 + kTie));
  const auto found = std::lower_bound(c.by_tick.begin(), c.by_tick.end(), std::pair<int64_t, size_t>{tick, 0});
  return found != c.by_tick.end() && found->first == tick ? static_cast<int64_t>(found->second) : -1;
}

/// Common time of a frame; of its tick where its time stamp is bad.
double TimeOf(const Clock& c, size_t position) {
  const bool bad = std::binary_search(c.fit.bad.begin(), c.fit.bad.end(), position);
  return bad ? c.TickTime(static_cast<double>(c.fit.tick[position])) : c.Common(c.times->time_s[position]);
}

/// Number of the frame at tick 0 of a common clock, which is also the number of the time step.
double FirstNumber(const Clock& c, TimelineClock kind) {
  if (kind != TimelineClock::kCommon) return 0;
  for (const auto& [tick, position] : c.by_tick) {
    if (tick >= 0) return static_cast<double>(c.times->frame[position] - tick);
  }
  return 0;
}

int64_t CountTimeSteps(const std::vector<Clock>& clocks, double start_s, double period_s) {
  std::vector<double> ends;
  for (const Clock& c : clocks) {
    if (c.placed && !c.by_time.empty()) ends.push_back(c.by_time.back().first + 0.5 * c.period_s);
  }
  std::sort(ends.rbegin(), ends.rend());
  const double end = ends[std::min<size_t>(1, ends.size() - 1)];
  const double count = std::floor((end - start_s) / period_s) + 1;
  if (count > kMaxTimeSteps) {
    throw FormatError(
        clocks[0].times->source, "",
        "the time stamps span " + std::to_string(count / 1e6) + " million time steps: are they in seconds, and of one take?");
  }
  return std::max<int64_t>(static_cast<int64_t>(count), 0);
}

void ListDropped(const Clock& c, CameraTimeline* out) {
  for (size_t i = 1; i < c.by_tick.size(); ++i) {
    const int64_t missing = c.by_tick[i].first - c.by_tick[i - 1].first - 1;
    int64_t doubled = 0;  // frames between that only repeat an image stand for a missing one each
    for (size_t k = c.by_tick[i - 1].second + 1; k < c.by_tick[i].second; ++k) doubled += c.fit.tick[k] != kNoTick;
    if (missing > doubled) out->dropped.push_back({c.times->frame[c.by_tick[i - 1].second], missing - doubled});
  }
}

void ListDoubled(const Clock& c, CameraTimeline* out) {
  std::set<int64_t> doubled(c.times->repeats.begin(), c.times->repeats.end());
  for (const size_t k : c.fit.same) doubled.insert(c.times->frame[k]);
  out->doubled.assign(doubled.begin(), doubled.end());
  for (const size_t k : c.fit.bad) out->bad_times.push_back(c.times->frame[k]);
}

/// Nominal rates of cameras; the nearest whole rate when none is near.
double NominalRate(double fps) {
  double best = std::max(std::round(fps), 1.0);
  for (const double rate : {24000.0 / 1001, 30000.0 / 1001, 48000.0 / 1001, 60000.0 / 1001, 120000.0 / 1001}) {
    if (std::abs(fps - rate) < std::abs(fps - best)) best = rate;
  }
  return best;
}

void DescribeClock(const Clock& c, const Clock& ref, TimelineClock kind, double start_s, CameraTimeline* out) {
  out->fps_hz = c.fit.period_s > 0 ? 1 / c.fit.period_s : 0;
  out->jitter_ms = 1000 * c.fit.jitter_s;
  if (!c.placed || c.period_s <= 0) return;
  const bool numbered = kind != TimelineClock::kCommon && c.times->origin_s;
  out->offset_frames = (start_s - (numbered ? c.Common(*c.times->origin_s) : c.TickTime(-FirstNumber(c, kind)))) / c.period_s;
  if (kind != TimelineClock::kCommon || &c == &ref) return;
  out->sigma_frames = std::hypot(c.fit.start_sigma_s, ref.fit.start_sigma_s) / c.period_s;
  const bool same = std::abs(c.period_s / ref.period_s - 1) < kSameRate;
  const double nominal = same ? 1 : NominalRate(1 / ref.period_s) / NominalRate(1 / c.period_s);
  const double rate = c.period_s / ref.period_s / nominal - 1;
  if (std::abs(rate) < kSameRate) {
    out->rate_ppm = 1e6 * rate;
    out->rate_sigma_ppm = 1e6 * std::hypot(c.fit.period_sigma_s / c.period_s, ref.fit.period_sigma_s / ref.period_s);
  }
}

void Assign(const Clock& c, const std::vector<double>& time_steps, double period_s, const TimelineOptions& options,
            CameraTimeline* out) {
  std::vector<double> sizes;
  for (size_t i = 0; i < time_steps.size(); ++i) {
    const int64_t at = c.placed ? FrameAt(c, time_steps[i], period_s) : -1;
    if (at < 0) continue;
    const double residual = TimeOf(c, static_cast<size_t>(at)) - time_steps[i];
    if (options.max_residual_ms > 0 && 1000 * std::abs(residual) > options.max_residual_ms) continue;
    out->frame_at[i] = c.times->frame[static_cast<size_t>(at)];
    out->residual_s[i] = residual;
    sizes.push_back(1000 * std::abs(residual));
  }
  if (sizes.empty()) return;
  out->residual_max_ms = *std::max_element(sizes.begin(), sizes.end());
  out->residual_median_ms = UpperMedian(std::move(sizes));
}

}  // namespace

std::string ToString(TimelineClock clock) {
  return clock == TimelineClock::kCommon ? "common" : clock == TimelineClock::kOffsets ? "offsets" : "start";
}

const CameraTimeline* Timeline::Find(const std::string& camera) const {
  for (const CameraTimeline& c : cameras) {
    if (c.name == camera) return &c;
  }
  return nullptr;
}

Timeline BuildTimeline(const std::vector<CameraTimes>& cameras, TimelineClock clock, const SyncFile* sync,
                       const TimelineOptions& options) {
  CheckTimes(cameras);
  std::vector<Clock> clocks;
  for (const CameraTimes& times : cameras) clocks.push_back(MakeClock(times, options));
  const std::vector<double> known = KnownOffsets(clocks, clock, sync);
  const std::string named = !options.reference.empty()                 ? options.reference
                            : clock == TimelineClock::kOffsets && sync ? sync->reference
                                                                       : "";
  const size_t reference = Reference(clocks, known, named, !options.reference.empty());
  PlaceClocks(clock, sync, known, reference, &clocks);
  for (Clock& c : clocks) ListFrames(&c);
  const Clock& ref = clocks[reference];

  Timeline timeline;
  timeline.reference = ref.times->camera;
  timeline.clock = clock;
  timeline.fps_hz = 1 / ref.period_s;
  const bool numbered = clock != TimelineClock::kCommon && ref.times->origin_s.has_value();
  timeline.start_s = numbered ? ref.Common(*ref.times->origin_s) : ref.TickTime(-FirstNumber(ref, clock));
  timeline.num_time_steps = CountTimeSteps(clocks, timeline.start_s, ref.period_s);
  std::vector<double> time_steps(static_cast<size_t>(timeline.num_time_steps));
  for (size_t i = 0; i < time_steps.size(); ++i) time_steps[i] = timeline.start_s + static_cast<double>(i) * ref.period_s;
  for (const Clock& c : clocks) {
    CameraTimeline& out = timeline.cameras.emplace_back();
    out.name = c.times->camera;
    out.source = c.times->source;
    out.status = c.placed || c.fit.status == ClockStatus::kNoTime ? c.fit.status : ClockStatus::kNoOffset;
    out.num_frames = static_cast<int64_t>(c.times->frame.size());
    out.frame_at.assign(time_steps.size(), -1);
    out.residual_s.assign(time_steps.size(), std::nan(""));
    DescribeClock(c, ref, clock, timeline.start_s, &out);
    ListDropped(c, &out);
    ListDoubled(c, &out);
    Assign(c, time_steps, ref.period_s, options, &out);
  }
  return timeline;
}

std::vector<std::pair<int64_t, int64_t>> TimeStepsOfFrames(const CameraTimeline& camera) {
  std::vector<std::pair<int64_t, int64_t>> rows;
  for (size_t i = 0; i < camera.frame_at.size(); ++i) {
    if (camera.frame_at[i] >= 0) rows.emplace_back(camera.frame_at[i], static_cast<int64_t>(i));
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

std::map<int64_t, int64_t> TimeStepOfEachFrame(const CameraTimeline& camera) {
  std::map<int64_t, std::vector<int64_t>> time_steps;
  for (const auto& [frame, time_step] : TimeStepsOfFrames(camera)) time_steps[frame].push_back(time_step);
  const auto distance_s = [&](int64_t time_step) { return std::abs(camera.residual_s.at(static_cast<size_t>(time_step))); };
  std::map<int64_t, int64_t> nearest;
  for (const auto& [frame, of] : time_steps) {
    nearest[frame] = of[(of.size() - 1) / 2];
    if (camera.residual_s.empty()) continue;
    nearest[frame] =
        *std::min_element(of.begin(), of.end(), [&](int64_t a, int64_t b) { return distance_s(a) < distance_s(b); });
  }
  return nearest;
}

std::vector<std::pair<int64_t, int64_t>> TicksOfFrames(const CameraTimes& camera) {
  std::vector<std::pair<int64_t, int64_t>> ticks;
  const ClockFit fit = internal::FitClock(camera.time_s);
  const bool counted = !camera.origin_s && fit.status == ClockStatus::kOk && fit.period_s > 0;
  for (size_t k = 0; k < camera.frame.size(); ++k) {
    if (!counted) {
      ticks.emplace_back(camera.frame[k], camera.frame[k]);
    } else if (fit.tick[k] != kNoTick) {
      ticks.emplace_back(camera.frame[k], fit.tick[k]);
    }
  }
  return ticks;
}

SyncFile SyncFromTimeline(const Timeline& timeline) {
  SyncFile sync;
  sync.reference = timeline.reference;
  sync.fps = timeline.fps_hz;
  for (const CameraTimeline& c : timeline.cameras) {
    SyncedCamera& entry = sync.cameras.emplace_back();
    entry.name = c.name;
    entry.status = ToString(c.status);
    if (entry.status != "Ok") continue;
    const double rate = c.fps_hz / timeline.fps_hz;
    if (std::abs(rate - 1) > kSameRate) entry.nominal_rate = rate * (1 + 1e-6 * c.rate_ppm);
    entry.offset_frames = c.name == timeline.reference ? 0 : c.offset_frames;
    entry.sigma_frames = c.sigma_frames;
    entry.rate_ppm = c.rate_ppm;
  }
  return sync;
}

}  // namespace mvstudio::dataset
