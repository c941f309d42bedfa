#include "dataset/pose/trc_layout.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/label.h"
#include "core/text/number_cell.h"

namespace mvstudio::dataset::internal {
namespace {

using Cells = std::vector<std::string_view>;

constexpr char kBlanks[] = " \t\r";

std::string_view Trim(std::string_view text) {
  const size_t first = text.find_first_not_of(kBlanks);
  return first == std::string_view::npos ? std::string_view() : text.substr(first, text.find_last_not_of(kBlanks) + 1 - first);
}

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

bool BeginsWith(std::string_view text, std::string_view lower) {
  return text.size() >= lower.size() && std::equal(lower.begin(), lower.end(), text.begin(), [](char a, char b) {
           return a == static_cast<char>(std::tolower(static_cast<unsigned char>(b)));
         });
}

struct Word {
  std::string text;
  size_t at = 0;  ///< its cell
};

std::vector<Word> WordsIn(const Cells& cells, size_t first = 0) {
  std::vector<Word> words;
  for (size_t i = first; i < cells.size(); ++i) {
    if (!cells[i].empty()) words.push_back({std::string(cells[i]), i});
  }
  return words;
}

/// A cell X1, y2, …; the number is 0 where there is none.
struct Axis {
  int axis = 0;
  int number = 0;
  size_t at = 0;
};

std::optional<Axis> ParseAxis(const Word& word) {
  const size_t axis = std::string_view("xyz").find(static_cast<char>(std::tolower(static_cast<unsigned char>(word.text[0]))));
  if (axis == std::string_view::npos) return std::nullopt;
  const std::string digits = word.text.substr(1);
  if (digits.size() > 6 || digits.find_first_not_of("0123456789") != std::string::npos) return std::nullopt;
  return Axis{static_cast<int>(axis), digits.empty() ? 0 : std::stoi(digits), word.at};
}

class Parser {
 public:
  Parser(const std::string& path, std::string_view text) : path_(path), rest_(text) {
    if (rest_.substr(0, 3) == "\xef\xbb\xbf") rest_.remove_prefix(3);
  }

  TrcLayout Read() {
    ReadValues();
    const Cells names = Line("frame", "Frame#, Time and the names of the markers");
    const int names_line = line_;
    ReadAxes();
    Name(names, names_line);
    CheckCount();
    return std::move(layout_);
  }

 private:
  [[noreturn]] void Fail(int line, const std::string& what) const {
    throw FormatError(path_, "line " + std::to_string(line), what);
  }

  bool Next(std::string_view* line) {
    if (rest_.empty()) return false;
    const size_t end = std::min(rest_.find('\n'), rest_.size());
    *line = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    ++line_;
    return true;
  }

  /// The first line below whose first cell begins with the word.
  Cells Line(std::string_view word, const std::string& what) {
    constexpr int kMost = 8;
    std::string_view line;
    for (const int from = line_; line_ < from + kMost && Next(&line);) {
      if (BeginsWith(Trim(line), word)) return TrcCells(line, TrcSeparator(line));
    }
    throw FormatError(path_, "header", "has no line of " + what + "; this is not a .trc file");
  }

  void ReadValues() {
    const std::vector<Word> names = WordsIn(Line("datarate", "DataRate, …, NumMarkers, Units"));
    std::string_view line;
    while (Next(&line) && Trim(line).empty()) {
    }
    const Cells cells = TrcCells(line, TrcSeparator(line));
    const std::vector<Word> values = WordsIn(cells);
    for (size_t i = 0; i < names.size(); ++i) {
      // Values are padded with blanks and empty cells by some programs; where one is missing, places count.
      std::string& value = layout_.values[Lower(names[i].text)];
      if (values.size() == names.size())
        value = values[i].text;
      else if (names[i].at < cells.size())
        value = std::string(cells[names[i].at]);
    }
  }

  /// The line X1, Y1, Z1, …; axes_ stays empty where another line follows the names.
  void ReadAxes() {
    const Parser before = *this;
    std::string_view line;
    if (!Next(&line)) return;
    layout_.num_lines = static_cast<size_t>(line_);
    const std::vector<Word> words = WordsIn(TrcCells(line, TrcSeparator(line)));
    for (const Word& word : words) {
      const std::optional<Axis> axis = ParseAxis(word);
      if (axis) {
        axes_.push_back(*axis);
        continue;
      }
      if (!axes_.empty() || ReadNumberCell(words[0].text).kind != NumberCell::Kind::kNumber)
        Fail(line_, "`" + word.text.substr(0, 40) + "` is none of X1, Y1, Z1, …, which name the columns");
      rest_ = before.rest_, line_ = before.line_;  // a row of numbers
      layout_.num_lines = static_cast<size_t>(line_);
      return;
    }
    GroupAxes();
  }

  /// Columns of each marker: by the numbers behind X, Y and Z, else three that follow each other.
  void GroupAxes() {
    std::map<int, std::map<int, size_t>> by_number;
    std::vector<int> order;
    for (size_t k = 0; k < axes_.size(); ++k) {
      if (by_number.count(axes_[k].number) == 0) order.push_back(axes_[k].number);
      by_number[axes_[k].number].emplace(axes_[k].axis, k);
    }
    const bool numbered = 3 * order.size() == axes_.size() &&
                          std::all_of(by_number.begin(), by_number.end(), [](const auto& e) { return e.second.size() == 3; });
    for (size_t m = 0; 3 * m < axes_.size(); ++m) {
      std::map<int, size_t> columns;
      for (size_t k = 3 * m; k < std::min(3 * m + 3, axes_.size()); ++k) columns[axes_[k].axis] = k;
      if (numbered) columns = by_number[order[m]];
      if (columns.size() != 3) {
        Fail(line_, "the columns of marker " + std::to_string(m + 1) + " are not X, Y and Z: the line lists " +
                        std::to_string(axes_.size()) + " columns");
      }
      layout_.markers.push_back({"", {columns[0], columns[1], columns[2]}});
    }
  }

  void Name(const Cells& cells, int line) {
    const bool timed = cells.size() > 1 && BeginsWith(cells[1], "time");
    if (cells.size() < 2 || !(timed || cells[1].empty())) Fail(line, "the second column is not called Time");
    const std::vector<Word> names = WordsIn(cells, 2);
    if (axes_.empty()) {
      for (size_t m = 0; m < names.size(); ++m) layout_.markers.push_back({"", {3 * m, 3 * m + 1, 3 * m + 2}});
    }
    const size_t count = layout_.markers.size();
    if (names.size() > count) {
      Fail(line, std::to_string(names.size()) + " names for the columns of " + std::to_string(count) +
                     " markers; separate names from each other by tabs, and write X, Y, Z of each below");
    }
    const std::vector<size_t> places = names.size() == count ? std::vector<size_t>() : PlacesOf(names, line);
    for (size_t i = 0; i < names.size(); ++i) {
      layout_.markers[places.empty() ? i : places[i]].label = names[i].text;
    }
    FillNames(line);
  }

  /// The marker of each name where some have none.
  std::vector<size_t> PlacesOf(const std::vector<Word>& names, int line) const {
    std::vector<std::vector<size_t>> found;
    if (auto places = PlacesAbove(names)) return *places;
    const size_t first = axes_.empty() ? 2 : axes_[0].at;
    for (const size_t step : {3, 2, 1}) {
      std::vector<size_t> places;
      for (const Word& name : names) {
        if (first < 2 || name.at < first) break;
        const size_t from_first = name.at - first;
        if (from_first % step == 0 && from_first / step < layout_.markers.size()) places.push_back(from_first / step);
      }
      if (places.size() == names.size() && std::find(found.begin(), found.end(), places) == found.end())
        found.push_back(places);
    }
    if (found.size() == 1) return found[0];
    Fail(line, std::to_string(names.size()) + " names for the columns of " + std::to_string(layout_.markers.size()) +
                   " markers: which of them have no name cannot be told; name them all, or put each name above its X");
  }

  /// Where every name stands above an X: the marker below.
  std::optional<std::vector<size_t>> PlacesAbove(const std::vector<Word>& names) const {
    std::map<size_t, size_t> x;
    if (axes_.empty() || axes_[0].at < 2) return std::nullopt;
    for (size_t m = 0; m < layout_.markers.size(); ++m) x[axes_[layout_.markers[m].columns[0]].at] = m;
    std::vector<size_t> places;
    for (const Word& name : names) {
      const auto below = x.find(name.at);
      if (below == x.end()) return std::nullopt;
      places.push_back(below->second);
    }
    return places;
  }

  void FillNames(int line) {
    size_t without = 0;
    for (size_t m = 0; m < layout_.markers.size(); ++m) {
      std::string& label = layout_.markers[m].label;
      if (label.empty()) label = "point_" + std::to_string(m + 1), ++without;
      const std::string why = WhyNotALabel(label);
      if (!why.empty()) Fail(line, "the name of marker " + std::to_string(m + 1) + " " + why);
    }
    if (without > 0)
      layout_.notes.push_back(std::to_string(without) + " of " + std::to_string(layout_.markers.size()) +
                              " markers have no name; they are called point_N by their place");
  }

  void CheckCount() {
    const auto stated = layout_.values.find("nummarkers");
    const double count = stated == layout_.values.end() ? std::nan("") : TrcHeaderNumber(stated->second);
    if (std::isfinite(count) && count != static_cast<double>(layout_.markers.size()))
      layout_.notes.push_back("its header states " + stated->second + " markers, its columns are those of " +
                              std::to_string(layout_.markers.size()));
  }

  const std::string& path_;
  std::string_view rest_;
  int line_ = 0;
  std::vector<Axis> axes_;
  TrcLayout layout_;
};

}  // namespace

char TrcSeparator(std::string_view line) {
  line = Trim(line);
  for (const char separator : {'\t', ';'}) {
    if (line.find(separator) != std::string_view::npos) return separator;
  }
  const size_t comma = line.find(',');
  if (comma == std::string_view::npos) return ' ';
  const size_t blank = line.find(' ');
  // "1, 0.5" has commas between the cells, "1 0,5" in them.
  return blank == std::string_view::npos || line.find(", ") != std::string_view::npos ||
                 line.find(",,") != std::string_view::npos
             ? ','
             : ' ';
}

std::vector<std::string_view> TrcCells(std::string_view line, char separator) {
  std::vector<std::string_view> cells;
  if (separator != ' ') {
    for (size_t begin = 0; begin <= line.size();) {
      const size_t end = std::min(line.find(separator, begin), line.size());
      cells.push_back(Trim(line.substr(begin, end - begin)));
      begin = end + 1;
    }
    return cells;
  }
  for (size_t begin = 0; (begin = line.find_first_not_of(kBlanks, begin)) != std::string_view::npos;) {
    const size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
    cells.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return cells;
}

double TrcHeaderNumber(std::string_view text) {
  std::string plain(Trim(text));
  if (std::count(plain.begin(), plain.end(), ',') == 1) std::replace(plain.begin(), plain.end(), ',', '.');
  return ReadNumberCell(plain).value;
}

TrcLayout ReadTrcLayout(const std::string& path, std::string_view text) { return Parser(path, text).Read(); }

}  // namespace mvstudio::dataset::internal
