#include "dataset/pose/marker_formats.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>

#include "core/error.h"
#include "core/format.h"

namespace mvstudio::dataset::internal {

std::string LowerCase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

namespace {

/// A column's name taken apart: point, axis and unit; no axis: it is no coordinate.
struct ColumnName {
  std::string point, unit;
  int axis = -1;
};

constexpr char kBetween[] = "_.:- ";

ColumnName Split(std::string text) {
  ColumnName name;
  const size_t last = text.find_last_of(kBetween);
  if (last != std::string::npos && MetresPerUnit(text.substr(last + 1)) && last > 0)
    name.unit = LowerCase(text.substr(last + 1)), text.resize(last);
  if (text.size() < 3) return name;
  const int axis = std::tolower(static_cast<unsigned char>(text.back())) - 'x';
  if (axis < 0 || axis > 2) return name;
  size_t end = text.size() - 1;
  const char before = text[end - 1];
  if ((before == 't' || before == 'p') && end >= 3 && std::string(kBetween).find(text[end - 2]) != std::string::npos) --end;
  if (std::string(kBetween).find(text[end - 1]) == std::string::npos) return name;
  name.point = text.substr(0, end - 1);
  if (!name.point.empty()) name.axis = axis;
  return name;
}

}  // namespace

std::vector<ColumnTriple> FindTriples(const std::vector<std::string>& header, const std::string& path) {
  std::vector<ColumnTriple> found;
  std::map<std::string, size_t> index;
  for (size_t c = 0; c < header.size(); ++c) {
    const ColumnName name = Split(header[c]);
    if (name.axis < 0) continue;
    const auto [it, is_new] = index.emplace(name.point, found.size());
    if (is_new) found.push_back({name.point, {-1, -1, -1}, name.unit});
    ColumnTriple& triple = found[it->second];
    if (triple.columns[name.axis] >= 0) throw FormatError(path, "header", "column `" + header[c] + "` is there twice");
    if (triple.unit != name.unit) throw FormatError(path, "header", "columns of `" + name.point + "` have different units");
    triple.columns[name.axis] = static_cast<int>(c);
  }
  std::vector<ColumnTriple> whole;
  for (const ColumnTriple& triple : found) {
    if (std::count(triple.columns, triple.columns + 3, -1) == 0) whole.push_back(triple);
  }
  for (const ColumnTriple& triple : whole) {
    if (triple.unit != whole.front().unit)
      throw FormatError(path, "header", "columns have different units: `" + whole.front().unit + "` and `" + triple.unit + "`");
  }
  return whole;
}

std::string UnitOrAsk(const std::string& asked, const std::string& stated, const std::string& path) {
  if (!asked.empty()) return asked;
  if (MetresPerUnit(stated)) return stated;
  throw FormatError(path, "header",
                    "states no unit of its lengths; name it by option 'marker-unit' m, cm, mm, in or e.g. 25mm, or convert it: "
                    "mvstudio markers convert");
}

void AddMarkerRow(int frame, int person, const std::string& joint, const Eigen::Vector3d& metres_in_world, Pose3d* pose) {
  JointRow& row = pose->rows.emplace_back();
  row.frame = frame, row.person = person, row.joint = joint;
  if (!metres_in_world.allFinite()) return;
  row.status = Status::kOk, row.x_in_world = metres_in_world;
}

void SortByFrame(const std::string& path, Pose3d* pose) {
  std::stable_sort(pose->rows.begin(), pose->rows.end(), [](const JointRow& a, const JointRow& b) {
    return std::pair(a.frame, a.person) < std::pair(b.frame, b.person);
  });
  std::set<std::string_view> seen;
  for (size_t i = 0; i < pose->rows.size(); ++i) {
    const JointRow& row = pose->rows[i];
    if (i > 0 && (row.frame != pose->rows[i - 1].frame || row.person != pose->rows[i - 1].person)) seen.clear();
    if (!seen.insert(row.joint).second)
      throw FormatError(path, "frame " + std::to_string(row.frame),
                        "`" + row.joint.substr(0, 40) + "` of person " + std::to_string(row.person) +
                            " is there twice; was the file put together from two takes?");
  }
}

double RateOf(const std::vector<std::pair<int, double>>& times, std::vector<std::string>* notes) {
  const std::pair<int, double>*first = nullptr, *last = nullptr;
  for (const auto& entry : times) {
    if (!std::isfinite(entry.second)) continue;
    if (!first || entry.first < first->first) first = &entry;
    if (!last || entry.first > last->first) last = &entry;
  }
  const auto falls = [](const auto& a, const auto& b) { return b.first > a.first && b.second < a.second; };
  if (std::adjacent_find(times.begin(), times.end(), falls) != times.end())
    notes->push_back("its times do not rise with its frames");
  if (!first || last->first == first->first || !(last->second > first->second)) return 0;
  const double seconds = (last->second - first->second) / (last->first - first->first);
  double worst = 0;
  for (const auto& [frame, time] : times) {
    if (std::isfinite(time)) worst = std::max(worst, std::abs(time - first->second - (frame - first->first) * seconds));
  }
  if (worst > 0.5 * seconds)
    notes->push_back(Format("its times are not even: up to %.3g s from those of %.4g frames a second", worst, 1 / seconds));
  // 0.0333333 s and its like are rounded: the nearest whole rate counts where the times cannot tell it from theirs.
  const double rate_hz = 1 / seconds, whole = std::round(rate_hz);
  return whole > 0 && std::abs(rate_hz - whole) < 2e-5 * whole ? whole : rate_hz;
}

}  // namespace mvstudio::dataset::internal
