#include "core/text/row_times.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "core/format.h"

namespace mvstudio {

bool IsTimeColumn(std::string_view name) {
  std::string plain;  // "Time (ms)" is timems
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c))) plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  for (const std::string_view unit : {"", "s", "sec", "seconds", "ms", "us", "ns"}) {
    for (const std::string_view clock : {"time", "timestamp", "t"}) {
      if (plain == std::string(clock) + std::string(unit)) return true;
    }
  }
  return plain == "seconds" || plain == "msec";
}

std::optional<RowFrames> FramesOfTimes(const std::vector<double>& times, std::string* why, double step) {
  constexpr double kUneven = 0.35, kLastFrame = 1e6;  // shares of a step; frames
  std::vector<double> steps;
  if (!std::all_of(times.begin(), times.end(), [](double time) { return std::isfinite(time); })) {
    *why = "a row has none";
    return std::nullopt;
  }
  for (size_t i = 1; i < times.size(); ++i) {
    if (times[i] < times[i - 1]) {
      *why = Format("%.6g comes after %.6g", times[i], times[i - 1]);
      return std::nullopt;
    }
    if (times[i] > times[i - 1]) steps.push_back(times[i] - times[i - 1]);
  }
  if (step == 0 && steps.size() < 2) {
    *why = "fewer than three of them differ, which tells no rate";
    return std::nullopt;
  }
  std::sort(steps.begin(), steps.end());
  const double usual = step > 0 ? step : steps[steps.size() / 2];
  RowFrames found;
  found.frames = {0};
  double passed = 0;
  for (size_t i = 1; i < times.size(); ++i) {
    const double share = (times[i] - times[i - 1]) / usual, whole = std::round(share);
    if (std::abs(share - whole) > kUneven || (share > 0 && whole == 0) || passed + whole > kLastFrame) {
      *why = Format("the step from %.6g to %.6g is %.3g of the usual %.6g, no multiple of it", times[i - 1], times[i], share,
                    usual);
      return std::nullopt;
    }
    found.frames.push_back(static_cast<int>(passed += whole));
  }
  found.step = passed > 0 ? (times.back() - times.front()) / passed : usual;  // stamps may be rounded, as 33 ms
  const double first = std::round(times.front() / found.step);
  if (!(std::abs(first) <= kLastFrame) || first < 0) {
    *why = Format("they begin at %.10g, which is no time from the recording's start", times.front());
    return std::nullopt;
  }
  for (int& frame : found.frames) frame += static_cast<int>(first);
  return found;
}

}  // namespace mvstudio
