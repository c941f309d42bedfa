#include "dataset/time/clock_fit.h"

#include <algorithm>
#include <cmath>

#include "core/statistics.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr double kSame = 0.2;         // of a period: two time stamps nearer than this are one
constexpr double kOffGrid = 0.25;     // of a period
constexpr double kMostOffGrid = 0.2;  // share of steps that may be off the grid of whole periods
constexpr double kFollow = 0.1;       // how fast the tick count follows a wandering clock
constexpr double kMaxTime = 1e12;     // seconds: 30 000 years
constexpr double kMaxStep = 1e9;      // periods

/// Positions of a longest subsequence of finite, non-descending times (patience sorting).
std::vector<size_t> LongestAscending(const std::vector<double>& t) {
  std::vector<size_t> tails, before(t.size(), SIZE_MAX);
  for (size_t i = 0; i < t.size(); ++i) {
    if (!(std::abs(t[i]) < kMaxTime)) continue;
    const auto at = std::upper_bound(tails.begin(), tails.end(), t[i], [&](double value, size_t k) { return value < t[k]; });
    if (at != tails.begin()) before[i] = *(at - 1);
    if (at == tails.end()) {
      tails.push_back(i);
    } else {
      *at = i;
    }
  }
  std::vector<size_t> chosen;
  for (size_t i = tails.empty() ? SIZE_MAX : tails.back(); i != SIZE_MAX; i = before[i]) chosen.push_back(i);
  std::reverse(chosen.begin(), chosen.end());
  return chosen;
}

/// Median of the steps above zero, then the mean of those near it; 0 without any.
double TypicalStep(const std::vector<double>& t, const std::vector<size_t>& good) {
  std::vector<double> steps;
  for (size_t i = 1; i < good.size(); ++i) {
    const double step = (t[good[i]] - t[good[i - 1]]) / static_cast<double>(good[i] - good[i - 1]);
    if (step > 0 && good[i] == good[i - 1] + 1) steps.push_back(step);
  }
  if (steps.empty()) return 0;
  const double median = UpperMedian(steps);
  double sum = 0;
  int count = 0;
  for (const double step : steps) {
    if (step > 0.5 * median && step < 1.5 * median) sum += step, ++count;
  }
  return sum / count;
}

/// Whole steps of the clock between frames, following its phase.
void CountTicks(const std::vector<double>& t, const std::vector<size_t>& good, double period, ClockFit* fit) {
  fit->tick.assign(t.size(), kNoTick);
  fit->same.clear();
  double phase = t[good[0]];  // where the line is at `last`
  int64_t last = 0;
  size_t before = good[0];
  fit->tick[before] = 0;
  for (size_t i = 1; i < good.size(); ++i) {
    const size_t k = good[i];
    const double steps = std::min((t[k] - phase) / period, kMaxStep);
    int64_t step = std::llround(steps);
    if (step < 1 && t[k] - t[before] < kSame * period) {
      fit->same.push_back(k);
      continue;
    }
    const bool late = fit->tick[before] == last && last >= 2 && step < 1;
    if (late && i >= 2 && fit->tick[good[i - 2]] != kNoTick && fit->tick[good[i - 2]] < last - 1) {
      fit->tick[before] = --last;  // the one before came late, not this one twice
      phase -= period;
      step = 1;
    }
    step = std::max<int64_t>(step, 1);
    last += step;
    phase += static_cast<double>(step) * period;
    phase += kFollow * std::clamp(t[k] - phase, -0.5 * period, 0.5 * period);
    fit->tick[k] = last;
    before = k;
  }
}

/// time = start + period * tick, by least squares with Huber weights (Huber, "Robust Statistics", 1981).
void FitLine(const std::vector<double>& t, ClockFit* fit) {
  std::vector<double> x, y;
  for (size_t k = 0; k < t.size(); ++k) {
    if (fit->tick[k] != kNoTick) x.push_back(static_cast<double>(fit->tick[k])), y.push_back(t[k]);
  }
  if (x.size() < 2) return;
  std::vector<double> weight(x.size(), 1), residual(x.size()), size(x.size());
  double x_mean = 0, y_mean = 0, xx = 0;
  for (int iteration = 0; iteration < 8; ++iteration) {
    double sum = 0, xy = 0;
    x_mean = y_mean = xx = 0;
    for (size_t i = 0; i < x.size(); ++i) sum += weight[i], x_mean += weight[i] * x[i], y_mean += weight[i] * y[i];
    x_mean /= sum, y_mean /= sum;
    for (size_t i = 0; i < x.size(); ++i) {
      xx += weight[i] * (x[i] - x_mean) * (x[i] - x_mean);
      xy += weight[i] * (x[i] - x_mean) * (y[i] - y_mean);
    }
    if (!(xx > 0)) return;
    fit->period_s = xy / xx;
    for (size_t i = 0; i < x.size(); ++i) {
      residual[i] = y[i] - y_mean - fit->period_s * (x[i] - x_mean);
      size[i] = std::abs(residual[i]);
    }
    const double scale = std::max(1.5 * kSigmaPerMad * UpperMedian(size), 1e-12);
    for (size_t i = 0; i < x.size(); ++i) weight[i] = size[i] <= scale ? 1 : scale / size[i];
  }
  double squares = 0;
  for (const double r : residual) squares += r * r;
  const double n = static_cast<double>(x.size());
  fit->jitter_s = std::sqrt(squares / n);
  fit->worst_s = LowerQuantile(std::move(size), 0.99);
  fit->start_s = y_mean - fit->period_s * x_mean;
  const double variance = n > 2 ? squares / (n - 2) : 0;
  fit->period_sigma_s = std::sqrt(variance / xx);
  fit->start_sigma_s = std::sqrt(variance * (1 / n + x_mean * x_mean / xx));
}

bool IsVariable(const std::vector<double>& t, const std::vector<size_t>& good, double period) {
  size_t off = 0, steps = 0;
  for (size_t i = 1; i < good.size(); ++i) {
    const double step = (t[good[i]] - t[good[i - 1]]) / period;
    if (good[i] != good[i - 1] + 1 || step < kSame) continue;
    ++steps;
    off += std::abs(step - std::max(std::round(step), 1.0)) > kOffGrid;
  }
  return steps >= 5 && static_cast<double>(off) > kMostOffGrid * static_cast<double>(steps);
}

/// Frames without a good time stamp get ticks when as many are free between their neighbours.
void FillBad(ClockFit* fit) {
  for (size_t begin = 0; begin < fit->bad.size();) {
    size_t end = begin + 1;
    while (end < fit->bad.size() && fit->bad[end] == fit->bad[end - 1] + 1) ++end;
    const size_t first = fit->bad[begin], last = fit->bad[end - 1];
    const bool inside = first > 0 && last + 1 < fit->tick.size();
    if (inside && fit->tick[first - 1] != kNoTick && fit->tick[last + 1] != kNoTick) {
      const int64_t from = fit->tick[first - 1];
      if (fit->tick[last + 1] - from - 1 == static_cast<int64_t>(end - begin)) {
        for (size_t i = begin; i < end; ++i) fit->tick[fit->bad[i]] = from + 1 + static_cast<int64_t>(i - begin);
      }
    }
    begin = end;
  }
}

}  // namespace

ClockFit FitClock(const std::vector<double>& time_s) {
  ClockFit fit;
  const std::vector<size_t> good = LongestAscending(time_s);
  fit.tick.assign(time_s.size(), kNoTick);
  for (size_t k = 0, i = 0; k < time_s.size(); ++k) {
    if (i < good.size() && good[i] == k) {
      ++i;
    } else {
      fit.bad.push_back(k);
    }
  }
  if (good.empty() || 2 * good.size() < time_s.size()) {
    fit.status = ClockStatus::kNoTime;
    return fit;
  }
  fit.start_s = time_s[good[0]];
  fit.tick[good[0]] = 0;
  fit.period_s = TypicalStep(time_s, good);
  if (fit.period_s <= 0) return fit;
  if (IsVariable(time_s, good, fit.period_s)) {
    fit.status = ClockStatus::kVariable;
    for (size_t i = 1; i < good.size(); ++i) {
      if (time_s[good[i]] == time_s[good[i - 1]]) fit.same.push_back(good[i]);
    }
    return fit;
  }
  for (int round = 0; round < 3; ++round) {
    CountTicks(time_s, good, fit.period_s, &fit);
    FitLine(time_s, &fit);
  }
  FillBad(&fit);
  return fit;
}

}  // namespace mvstudio::dataset::internal
