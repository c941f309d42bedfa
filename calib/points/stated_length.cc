#include "calib/points/stated_length.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr double kBodySigma = 0.07;  // of a segment, as a part of its length

std::optional<double> Metres(const std::string& text) {
  const std::map<std::string, double> units = {{"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}, {"in", 0.0254}};
  size_t used = 0;
  try {
    const double value = std::stod(text, &used);
    const auto unit = units.find(text.substr(used));
    if (unit != units.end() && std::isfinite(value)) return value * unit->second;
  } catch (const std::exception&) {
  }
  return std::nullopt;
}

std::vector<std::string> SplitAtColons(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) c == ':' ? (void)parts.emplace_back() : parts.back().push_back(c);
  return parts;
}

double MedianError(const std::vector<double>& values) {
  constexpr size_t kStretches = 10;
  const size_t n = values.size(), count = std::min(n, kStretches);
  if (count < 2) return std::nan("");
  std::vector<double> medians;
  for (size_t s = 0; s < count; ++s) {
    const auto at = [&](size_t i) { return values.begin() + static_cast<std::ptrdiff_t>(i * n / count); };
    medians.push_back(LinearQuantile(std::vector<double>(at(s), at(s + 1)), 0.5));
  }
  const double spread = PopulationDeviation(medians);
  return spread / std::sqrt(static_cast<double>(count) - 1);
}

std::string KnownNames(const std::vector<std::string>& names) {
  constexpr size_t kShown = 12;
  const auto end = names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kShown));
  return Join(std::vector<std::string>(names.begin(), end), ", ") + (names.size() > kShown ? ", …" : "");
}

/// Of one length; false, and a status, where it cannot be measured.
bool Measure(const std::vector<NamedPoints>& moments, LengthScale::Row* row, LengthScale* out) {
  constexpr double kNormalOfMiddleHalf = 1.349;
  std::vector<double> measured;
  for (const NamedPoints& points : moments) {
    const auto a = points.find(row->length.from), b = points.find(row->length.to);
    if (a != points.end() && b != points.end()) measured.push_back((a->second - b->second).norm());
  }
  row->num_moments = static_cast<int>(measured.size());
  row->measured_m = LinearQuantile(measured, 0.5);
  if (measured.empty()) {
    out->status = Status::kTooFewViews;
    out->message =
        row->length.from + " and " + row->length.to + " have no points at the same time, so their distance is unknown";
  } else if (!(row->measured_m > 0)) {
    out->status = Status::kDegenerate, out->message = row->length.from + " and " + row->length.to + " are at one place";
  }
  if (out->status != Status::kOk) return false;
  row->scale = row->length.length_m / row->measured_m;
  if (measured.size() >= 3)
    row->spread = (LinearQuantile(measured, 0.75) - LinearQuantile(measured, 0.25)) / kNormalOfMiddleHalf / row->measured_m;
  const double stated = row->length.sigma_m / row->length.length_m, found = MedianError(measured) / row->measured_m;
  row->sigma = std::isfinite(found) ? std::hypot(stated, found) : stated > 0 ? stated : std::nan("");
  return true;
}

/// Weighted mean of the rows' scales. Without an error of its own a length counts as the least certain one.
void Combine(LengthScale* out) {
  double least_certain = 0, sum = 0, weights = 0, squares = 0;
  bool known = true;
  for (const LengthScale::Row& row : out->rows) {
    if (std::isfinite(row.sigma)) least_certain = std::max(least_certain, row.sigma);
    known = known && std::isfinite(row.sigma);
  }
  const bool any = least_certain > 0;
  const auto sigma_of = [&](const LengthScale::Row& row) {
    return any ? std::max(std::isfinite(row.sigma) ? row.sigma : least_certain, 1e-3 * least_certain) : 1;
  };
  for (const LengthScale::Row& row : out->rows) {
    const double weight = 1 / (sigma_of(row) * sigma_of(row));
    sum += weight * std::log(row.scale), weights += weight;
  }
  const double mean = sum / weights, dof = static_cast<double>(out->rows.size()) - 1;
  for (size_t i = 0; i < out->rows.size(); ++i) {
    const double off = std::abs(std::log(out->rows[i].scale) - mean) / sigma_of(out->rows[i]);
    squares += off * off;
    if (any && dof > 0 && off > out->disagreement) out->disagreement = off, out->worst = i;
  }
  out->scale = std::exp(mean);
  if (dof > 0 && !any) out->sigma = std::sqrt(squares / dof / weights);
  if (known && any) out->sigma = std::sqrt(1 / weights) * std::max(1.0, dof > 0 ? std::sqrt(squares / dof) : 1.0);
  if (known && !any && !(dof > 0)) out->sigma = 0;
}

}  // namespace

StatedLength ParseStatedLength(const std::string& text) {
  const auto fail = [&](const std::string& why) {
    return UsageError("option 'length' '" + text + "': " + why +
                      "; give POINT:POINT:LENGTH, e.g. LShoulder:RShoulder:380mm or A:B:1.75m:2mm (with its standard "
                      "deviation), or Height:1.75m");
  };
  std::vector<std::string> parts = SplitAtColons(text);
  std::vector<double> lengths;
  while (parts.size() > 1 && lengths.size() < 2) {
    const std::optional<double> metres = Metres(parts.back());
    if (!metres) break;
    lengths.insert(lengths.begin(), *metres), parts.pop_back();
  }
  if (lengths.empty()) throw fail("no length with a unit (m, cm, mm, in) at its end");
  StatedLength stated{parts[0], parts.size() > 1 ? parts[1] : "", lengths[0], lengths.size() > 1 ? lengths[1] : 0};
  const bool height = parts.size() == 1 && stated.from == kHeightOfPerson;
  if (!(stated.length_m > 0)) throw fail("a length must be above 0");
  if (lengths.size() > 1 && !(stated.sigma_m > 0)) throw fail("a standard deviation must be above 0");
  if (!(stated.sigma_m < stated.length_m)) throw fail("the standard deviation is as large as the length");
  if (parts.size() > 2) throw fail("more than two points");
  if (!height && (stated.from.empty() || stated.to.empty())) throw fail("two points are needed");
  if (stated.from == stated.to) throw fail("the two points are one");
  return stated;
}

std::vector<StatedLength> ParseStatedLengths(const std::vector<std::string>& texts) {
  std::vector<StatedLength> lengths;
  for (const std::string& text : texts) lengths.push_back(ParseStatedLength(text));
  return lengths;
}

std::vector<StatedLength> LengthsOf(const std::vector<StatedLength>& stated, const std::vector<std::string>& names) {
  const auto has = [&](const std::string& name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  constexpr struct {
    const char *from, *to;
    double share;
  } kSegments[] = {{"Hip", "Knee", 0.245}, {"Knee", "Ankle", 0.246}, {"Shoulder", "Elbow", 0.186}, {"Elbow", "Wrist", 0.146}};
  std::vector<StatedLength> lengths;
  for (const StatedLength& each : stated) {
    for (const std::string& name : {each.from, each.to})
      if (!each.IsHeight() && !has(name))
        throw UsageError("option 'length' '" + each.Name() + "': there is no point '" + name + "'; the points are " +
                         KnownNames(names));
    const size_t before = lengths.size();
    if (!each.IsHeight()) lengths.push_back(each);
    for (const auto& segment : kSegments) {
      for (const std::string side : {"L", "R"}) {
        const std::string from = side + segment.from, to = side + segment.to;
        const double length_m = segment.share * each.length_m;
        if (each.IsHeight() && has(from) && has(to))
          lengths.push_back({from, to, length_m, std::hypot(kBodySigma * length_m, segment.share * each.sigma_m)});
      }
    }
    if (lengths.size() == before)
      throw UsageError("option 'length' 'Height': a height needs a person's joints (LHip, LKnee, …); the points are " +
                       KnownNames(names));
  }
  return lengths;
}

LengthScale ScaleFromLengths(const std::vector<StatedLength>& lengths, const std::vector<NamedPoints>& moments) {
  LengthScale out;
  for (const StatedLength& length : lengths) {
    LengthScale::Row row;
    row.length = length;
    if (!Measure(moments, &row, &out)) return out;
    out.rows.push_back(row);
  }
  if (out.rows.empty()) return out.status = Status::kTooFewViews, out.message = "no length is stated", out;
  Combine(&out);
  return out;
}

}  // namespace mvstudio::calib
