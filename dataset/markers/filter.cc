#include "dataset/markers/filter.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>

#include "core/error.h"
#include "core/format.h"

namespace mvstudio::markers {
namespace {

using Kind = FilterSpec::Kind;

struct Form {
  const char* word;
  Kind kind;
  double usual;
  const char* unit;
};

constexpr std::array<Form, 5> kForms = {{{"none", Kind::kNone, 0, ""},
                                         {"butterworth", Kind::kButterworth, 6, "Hz"},
                                         {"kalman", Kind::kKalman, 0, ""},
                                         {"gaussian", Kind::kGaussian, 0.02, "s"},
                                         {"median", Kind::kMedian, 5, ""}}};

[[noreturn]] void FailForm(const std::string& text, const std::string& why = "") {
  throw UsageError("filter `" + text + "`" + why + ": give butterworth:6Hz, kalman, gaussian:0.02s, median:5 or none");
}

const Form& FormOf(Kind kind) {
  return *std::find_if(kForms.begin(), kForms.end(), [kind](const Form& form) { return form.kind == kind; });
}

/// The number of `text`, which may carry `unit`.
double ParseValue(const std::string& text, const std::string& unit, const std::string& whole) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const std::string rest(end, text.data() + text.size());
  if (error != std::errc() || !(value > 0) || !std::isfinite(value) || (!rest.empty() && rest != unit)) FailForm(whole);
  return value;
}

/// A run of consecutive positions of one marker.
struct Run {
  std::array<std::vector<double>, 3> axes;
  std::vector<double> sigma;
};

Run ReadRun(const MarkerTake& take, int marker, int begin, int end) {
  Run run;
  for (int f = begin; f < end; ++f) {
    const size_t i = take.Index(f, marker);
    for (int k = 0; k < 3; ++k) run.axes[static_cast<size_t>(k)].push_back(take.x_in_world[i][k]);
    run.sigma.push_back(take.sigma_m[i]);
  }
  return run;
}

void WriteRun(const Run& run, int marker, int begin, MarkerTake* take) {
  for (size_t f = 0; f < run.sigma.size(); ++f) {
    for (size_t k = 0; k < 3; ++k)
      take->x_in_world[take->Index(begin + static_cast<int>(f), marker)][static_cast<Eigen::Index>(k)] = run.axes[k][f];
  }
}

/// Filled positions count for nothing; where no sigma is known at all, they are all alike.
void PrepareForKalman(const MarkerTake& take, int marker, int begin, Run* run) {
  constexpr double kUnknownSigmaM = 0.01;
  for (size_t f = 0; f < run->sigma.size(); ++f) {
    const size_t i = take.Index(begin + static_cast<int>(f), marker);
    if (take.source[i] == Source::kFilled) {
      for (auto& axis : run->axes) axis[f] = std::nan("");
    }
    if (!(run->sigma[f] > 0)) run->sigma[f] = kUnknownSigmaM;
  }
}

void SmoothKalman(const FilterSpec& filter, const MarkerTake& take, int marker, int begin, Run* run) {
  PrepareForKalman(take, marker, begin, run);
  const double density =
      filter.value > 0 ? filter.value : LikeliestJerk({run->axes.begin(), run->axes.end()}, run->sigma, take.rate_hz);
  for (auto& axis : run->axes) axis = KalmanSmooth(axis, run->sigma, density, take.rate_hz);
}

std::vector<double> FilterAxis(const FilterSpec& filter, const std::vector<double>& values, double rate_hz) {
  switch (filter.kind) {
    case Kind::kButterworth:
      return Butterworth(values, filter.value, rate_hz);
    case Kind::kGaussian:
      return GaussianMean(values, filter.value * rate_hz);
    case Kind::kMedian:
      return MovingMedian(values, static_cast<int>(filter.value));
    case Kind::kKalman:  // needs all axes at once
    case Kind::kNone:
      break;
  }
  return values;
}

void FilterRun(const FilterSpec& filter, int marker, int begin, int end, MarkerTake* take) {
  Run run = ReadRun(*take, marker, begin, end);
  if (filter.kind == Kind::kKalman) {
    SmoothKalman(filter, *take, marker, begin, &run);
  } else {
    for (auto& axis : run.axes) axis = FilterAxis(filter, axis, take->rate_hz);
  }
  WriteRun(run, marker, begin, take);
}

}  // namespace

FilterSpec ParseFilter(const std::string& text) {
  const size_t colon = text.find(':');
  const std::string word = text.substr(0, colon);
  for (const Form& form : kForms) {
    if (word != form.word) continue;
    FilterSpec filter{form.kind, form.usual};
    if (colon == std::string::npos) return filter;
    if (filter.kind == Kind::kNone) FailForm(text);
    filter.value = ParseValue(text.substr(colon + 1), form.unit, text);
    const bool is_odd = std::fmod(filter.value, 2) == 1;
    if (filter.kind == Kind::kMedian && (!is_odd || filter.value > 1e6))
      FailForm(text, " (a median needs an odd number of frames)");
    return filter;
  }
  FailForm(text);
}

std::string ToText(const FilterSpec& filter) {
  const Form& form = FormOf(filter.kind);
  if (filter.value == 0) return form.word;
  return Format("%s:%g%s", form.word, filter.value, form.unit);
}

void Filter(const FilterSpec& filter, MarkerTake* take) {
  if (filter.kind == Kind::kNone) return;
  for (int m = 0; m < take->num_markers(); ++m) {
    int begin = -1;
    for (int f = 0; f <= take->num_frames(); ++f) {
      const bool has = f < take->num_frames() && take->source[take->Index(f, m)] != Source::kMissing;
      if (has && begin < 0) begin = f;
      if (has || begin < 0) continue;
      FilterRun(filter, m, begin, f, take);
      begin = -1;
    }
  }
}

std::vector<double> GaussianMean(const std::vector<double>& values, double sigma_frames) {
  const int count = static_cast<int>(values.size());
  const int reach = static_cast<int>(std::min<double>(count, std::ceil(4 * sigma_frames)));
  std::vector<double> result(values.size());
  for (int i = 0; i < count; ++i) {
    double sum = 0, weights = 0;
    for (int j = std::max(0, i - reach); j <= std::min(count - 1, i + reach); ++j) {
      const double weight = std::exp(-0.5 * (i - j) * (i - j) / (sigma_frames * sigma_frames));
      sum += weight * values[static_cast<size_t>(j)], weights += weight;
    }
    result[static_cast<size_t>(i)] = sum / weights;
  }
  return result;
}

std::vector<double> MovingMedian(const std::vector<double>& values, int window) {
  std::vector<double> result(values.size());
  const size_t count = values.size(), most = static_cast<size_t>(window / 2);
  for (size_t i = 0; i < count; ++i) {
    const size_t half = std::min({most, i, count - 1 - i});
    std::vector<double> near(values.begin() + static_cast<std::ptrdiff_t>(i - half),
                             values.begin() + static_cast<std::ptrdiff_t>(i + half + 1));
    std::nth_element(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(half), near.end());
    result[i] = near[half];
  }
  return result;
}

}  // namespace mvstudio::markers
