#include "dataset/pose/pose3d_trc.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/text/number_cell.h"
#include "dataset/pose/marker_labels.h"
#include "dataset/pose/trc_layout.h"

namespace mvstudio::dataset {
namespace {

using internal::TrcLayout;

constexpr size_t kFreeRows = 100'000;

std::string ValueOf(const TrcLayout& layout, const char* name) {
  const auto found = layout.values.find(name);
  return found == layout.values.end() ? "" : found->second;
}

std::string UnitOf(const TrcLayout& layout, const std::string& path) {
  const std::string unit = ValueOf(layout, "units");
  if (MetresPerUnit(unit)) return unit;
  throw FormatError(path, "header",
                    (layout.values.count("units") == 0 ? std::string("has no column `Units`")
                                                       : "unit `" + unit + "` is none of m, cm, mm and in") +
                        "; name it by option 'marker-unit'");
}

/// Which mark coordinates have before their decimals, found over the whole file.
class DecimalMark {
 public:
  void See(std::string_view cell, int line) {
    const auto commas = std::count(cell.begin(), cell.end(), ',');
    const bool point = cell.find('.') != std::string_view::npos;
    if (commas == 0 && !point) num_plain_ += !cell.empty();
    if (commas == 0 && point && point_line_ == 0) point_line_ = line;
    if (commas == 0) return;
    if (comma_line_ == 0) comma_line_ = line, comma_ = std::string(cell.substr(0, 30));
    odd_ = odd_ || commas > 1 || point;
    // 1,234 beside 567 may count thousands.
    const size_t at = cell.find(',');
    thousands_ = thousands_ && cell.size() - at == 4 && at <= 4 && cell.find_first_not_of("+-0") < at;
  }

  /// True: a comma. Throws where it cannot be told.
  bool IsComma(const std::string& path) const {
    if (comma_line_ == 0) return false;
    const std::string place = "line " + std::to_string(comma_line_);
    if (odd_ || point_line_ > 0) {
      throw FormatError(path, place,
                        "`" + comma_ + "` has a comma, " +
                            (odd_ ? std::string("others have several or a point as well")
                                  : "numbers in line " + std::to_string(point_line_) + " have a decimal point") +
                            ": save the file with decimal points, and without marks between thousands");
    }
    if (thousands_ && num_plain_ > 0) {
      throw FormatError(path, place,
                        "`" + comma_ +
                            "`: whether its comma marks decimals or thousands cannot be told; save the file with "
                            "decimal points");
    }
    return true;
  }

 private:
  int point_line_ = 0, comma_line_ = 0;
  size_t num_plain_ = 0;
  bool odd_ = false, thousands_ = true;
  std::string comma_;
};

/// The rows below the header.
class Rows {
 public:
  Rows(const std::string& path, std::string_view text, const TrcLayout& layout) : path_(path), layout_(layout) {
    for (size_t line = 0; line < layout.num_lines && !text.empty(); ++line) {
      text.remove_prefix(std::min(text.find('\n'), text.size() - 1) + 1);
    }
    text_ = text;
    separator_ = SeparatorOf();
    Survey();
  }

  struct Row {
    int line = 0, frame = 0;
    double time_s = 0;                 ///< NaN: none
    std::vector<std::string> numbers;  ///< coordinates, with decimal points; cells at the end may be left out
  };

  /// Calls `use` for every row that holds something.
  template <class Use>
  void ForEach(Use&& use) const {
    const bool comma = mark_.IsComma(path_), time_comma = time_mark_.IsComma(path_);
    EachLine([&](const std::vector<std::string_view>& cells, int line) {
      Row row;
      row.line = line;
      const std::optional<int> frame = WholeNumberCell(Plain(cells[0], true), 1'000'000'000);
      if (!frame) Fail(line, "`" + std::string(cells[0].substr(0, 40)) + "` is not a frame number");
      row.frame = *frame;
      row.time_s = cells.size() > 1 ? ReadNumberCell(Plain(cells[1], time_comma)).value : std::nan("");
      for (size_t i = first_; i < cells.size(); ++i) row.numbers.push_back(Plain(cells[i], comma));
      while (!row.numbers.empty() && row.numbers.back().empty()) row.numbers.pop_back();
      const size_t count = 3 * layout_.markers.size();
      if (row.numbers.size() > count) {
        Fail(line, std::to_string(row.numbers.size()) + " columns of numbers, the header names those of " +
                       std::to_string(layout_.markers.size()) + " markers");
      }
      if (separator_ == ' ' && row.numbers.size() != count) {
        Fail(line, std::to_string(row.numbers.size()) + " numbers instead of " + std::to_string(count) +
                       ": with blanks between the columns a missing one cannot be placed; save the file with tabs");
      }
      use(row);
    });
  }

  [[noreturn]] void Fail(int line, const std::string& what) const {
    throw FormatError(path_, "line " + std::to_string(line), what);
  }

 private:
  static std::string Plain(std::string_view cell, bool comma) {
    std::string plain(cell);
    if (comma) std::replace(plain.begin(), plain.end(), ',', '.');
    return plain;
  }

  template <class Use>
  void EachLine(Use&& use) const {
    std::string_view rest = text_;
    for (int line = static_cast<int>(layout_.num_lines) + 1; !rest.empty(); ++line) {
      const size_t end = std::min(rest.find('\n'), rest.size());
      const std::string_view text = rest.substr(0, end);
      rest.remove_prefix(std::min(end + 1, rest.size()));
      if (text.find_first_not_of(" \t\r,;") == std::string_view::npos) continue;
      use(internal::TrcCells(text, separator_), line);
    }
  }

  /// The first column of coordinates and the decimal mark.
  void Survey() {
    bool shifted = true;
    size_t most = 0;
    EachLine([&](const std::vector<std::string_view>& cells, int) {
      size_t last = cells.size();
      while (last > 0 && cells[last - 1].empty()) --last;
      most = std::max(most, last);
      shifted = shifted && cells.size() > 2 && cells[2].empty();
    });
    // An empty column before all coordinates, as some headers have it.
    if (shifted && most > 2 + 3 * layout_.markers.size()) first_ = 3;
    EachLine([&](const std::vector<std::string_view>& cells, int line) {
      for (size_t i = 1; i < cells.size(); ++i) {
        if (i == 1) time_mark_.See(cells[i], line);
        if (i >= first_) mark_.See(cells[i], line);
      }
    });
  }

  /// That of the first row.
  char SeparatorOf() const {
    const size_t first = std::min(text_.find_first_not_of(" \t\r\n"), text_.size());
    return internal::TrcSeparator(text_.substr(first, text_.find('\n', first) - first));
  }

  const std::string& path_;
  const TrcLayout& layout_;
  std::string_view text_;
  size_t first_ = 2;
  char separator_ = '\t';
  DecimalMark mark_, time_mark_;
};

double Coordinate(const Rows& rows, const Rows::Row& row, size_t column) {
  if (column >= row.numbers.size()) return std::nan("");
  const NumberCell cell = ReadNumberCell(row.numbers[column]);
  if (cell.kind == NumberCell::Kind::kOther) {
    rows.Fail(row.line, "`" + row.numbers[column].substr(0, 40) + "`, coordinate " + std::to_string(column + 1) +
                            " of the line, is not a number");
  }
  return cell.value;
}

/// Frames and times of the rows, held against what the header states.
class FrameCheck {
 public:
  void Add(const Rows& rows, const Rows::Row& row) {
    const auto [known, is_new] = lines_.emplace(row.frame, row.line);
    if (!is_new) {
      rows.Fail(row.line, "frame " + std::to_string(row.frame) + " stands in line " + std::to_string(known->second) +
                              " as well; was the file put together from two takes?");
    }
    if (!std::isfinite(row.time_s)) return;
    falls_ = falls_ || (row.frame > last_frame_ && row.time_s < last_time_s_);
    last_frame_ = row.frame, last_time_s_ = row.time_s;
    if (times_.empty() || row.frame < times_.begin()->first || row.frame > times_.rbegin()->first)
      times_[row.frame] = row.time_s;
    if (times_.size() > 2) times_.erase(std::next(times_.begin()));
  }

  size_t size() const { return lines_.size(); }
  int first() const { return lines_.begin()->first; }
  /// Frames a second, as the header states them, else by the times; 0: neither says it.
  double RateHz(const TrcLayout& layout) const {
    const double stated_hz = internal::TrcHeaderNumber(ValueOf(layout, "datarate"));
    if (std::isfinite(stated_hz) && stated_hz > 0) return stated_hz;
    if (times_.size() < 2) return 0;
    const double hz = (times_.rbegin()->first - times_.begin()->first) / (times_.rbegin()->second - times_.begin()->second);
    return std::isfinite(hz) && hz > 0 ? hz : 0;
  }

  void AddNotes(const TrcLayout& layout, std::vector<std::string>* notes) const {
    const double frames = internal::TrcHeaderNumber(ValueOf(layout, "numframes"));
    const double rate_hz = internal::TrcHeaderNumber(ValueOf(layout, "datarate"));
    if (std::isfinite(frames) && frames != static_cast<double>(size())) {
      notes->push_back(Format("its header states %.0f frames, %zu are there", frames, size()) +
                       (frames > static_cast<double>(size()) ? "; was it cut off?" : ""));
    }
    const int span = lines_.rbegin()->first - lines_.begin()->first;
    if (static_cast<size_t>(span) + 1 > size())
      notes->push_back(
          Format("of its frames %d to %d, %zu are not there", first(), first() + span, static_cast<size_t>(span) + 1 - size()));
    if (falls_) notes->push_back("its times do not rise with its frames");
    if (times_.size() < 2 || !(rate_hz > 0)) return;
    const double seconds = times_.rbegin()->second - times_.begin()->second;
    const double of_times_hz = (times_.rbegin()->first - times_.begin()->first) / seconds;
    constexpr double kTolerance = 0.02;
    if (seconds != 0 && !(std::abs(of_times_hz / rate_hz - 1) <= kTolerance))
      notes->push_back(Format("its header states %g frames a second, its times are those of %.4g", rate_hz, of_times_hz));
  }

 private:
  bool falls_ = false;
  int last_frame_ = std::numeric_limits<int>::max();
  double last_time_s_ = 0;
  std::map<int, int> lines_;     ///< of each frame
  std::map<int, double> times_;  ///< of the first and the last frame with a time
};

void AddRow(const Rows& rows, const Rows::Row& row, const TrcLayout& layout, const std::vector<internal::MarkerLabel>& names,
            double metres, std::vector<JointRow>* list) {
  for (size_t m = 0; m < names.size(); ++m) {
    Eigen::Vector3d in_file;
    for (size_t k = 0; k < 3; ++k) in_file[static_cast<Eigen::Index>(k)] = Coordinate(rows, row, layout.markers[m].columns[k]);
    JointRow& joint = list->emplace_back();
    joint.frame = row.frame, joint.person = names[m].person, joint.joint = names[m].name;
    if (!in_file.allFinite()) continue;
    joint.status = Status::kOk;
    joint.x_in_world = metres * Eigen::Vector3d(in_file.z(), in_file.x(), in_file.y());
  }
}

}  // namespace

MarkerFile ReadTrcMarkers(const std::string& path, const std::string& unit) {
  const std::string text = ReadFile(path);
  const TrcLayout layout = internal::ReadTrcLayout(path, text);
  MarkerFile file;
  file.unit = unit.empty() ? UnitOf(layout, path) : unit;
  file.notes = layout.notes;
  std::vector<std::string> labels;
  for (const TrcLayout::Marker& marker : layout.markers) labels.push_back(marker.label);
  const std::vector<internal::MarkerLabel> names = internal::SplitLabels(labels);
  const Rows rows(path, text, layout);
  FrameCheck frames;
  Pose3d& pose = file.pose;
  pose.skeleton = "points";
  rows.ForEach([&](const Rows::Row& row) {
    // Cells at a line's end may be left out, but not so many that a small file becomes a huge table.
    if (pose.rows.size() + names.size() > text.size() + kFreeRows)
      rows.Fail(row.line, std::to_string(row.numbers.size()) + " numbers for " + std::to_string(names.size()) + " markers");
    frames.Add(rows, row);
    AddRow(rows, row, layout, names, MetresPerUnit(file.unit).value_or(1), &pose.rows);
  });
  if (pose.rows.empty()) throw FormatError(path, "", "no frames");
  frames.AddNotes(layout, &file.notes);
  pose.frame_rate_hz = frames.RateHz(layout);
  // The file counts from 1; one that begins with 0 counts as mvstudio does.
  const int base = std::min(1, frames.first());
  if (base == 0) file.notes.push_back("its frames count from 0 instead of 1; they are taken as they are");
  for (JointRow& row : pose.rows) row.frame -= base;
  std::stable_sort(pose.rows.begin(), pose.rows.end(), [](const JointRow& a, const JointRow& b) {
    return std::pair(a.frame, a.person) < std::pair(b.frame, b.person);
  });
  return file;
}

Pose3d ReadTrc(const std::string& path) { return ReadTrcMarkers(path).pose; }

}  // namespace mvstudio::dataset
