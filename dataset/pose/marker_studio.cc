#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "core/csv.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "core/text/number_cell.h"
#include "dataset/pose/marker_formats.h"
#include "dataset/pose/marker_labels.h"
#include "dataset/pose/marker_programs.h"

namespace mvstudio::dataset::internal {
namespace {

using StudioCells = std::vector<std::string>;

/// Lines of cells, in turn; blanks, quotes and a byte-order mark around cells are left out.
class StudioLines {
 public:
  StudioLines(const std::string& path, std::string_view text, char separator) : path_(path), separator_(separator) {
    if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
    rest_ = text;
  }

  bool Next() {
    cells_.clear();
    if (rest_.empty()) return false;
    const size_t end = std::min(rest_.find('\n'), rest_.size());
    std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    for (++number_;; line.remove_prefix(1)) {
      const size_t stop = std::min(line.find(separator_), line.size());
      cells_.push_back(Trimmed(line.substr(0, stop)));
      line.remove_prefix(stop);
      if (line.empty()) return true;
    }
  }
  bool IsBlank() const {
    return std::all_of(cells_.begin(), cells_.end(), [](const std::string& cell) { return cell.empty(); });
  }
  const StudioCells& cells() const { return cells_; }
  const std::string& At(int column) const {
    static const std::string none;
    return column >= 0 && static_cast<size_t>(column) < cells_.size() ? cells_[static_cast<size_t>(column)] : none;
  }
  double Number(int column) const {
    const NumberCell number = ReadNumberCell(At(column));
    if (number.kind == NumberCell::Kind::kOther)
      Fail("`" + At(column).substr(0, 40) + "` is not a number" + DecimalCommaHint(At(column)));
    return number.value;
  }
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(path_, "line " + std::to_string(number_), what); }
  const std::string& path() const { return path_; }

 private:
  static std::string Trimmed(std::string_view cell) {
    constexpr char kAround[] = " \r\"";
    const size_t begin = cell.find_first_not_of(kAround);
    if (begin == std::string_view::npos) return "";
    return std::string(cell.substr(begin, cell.find_last_not_of(kAround) - begin + 1));
  }

  const std::string path_;
  const char separator_;
  std::string_view rest_;
  StudioCells cells_;
  int number_ = 0;
};

/// What the lines above the numbers say.
struct StudioHead {
  std::string unit;
  bool y_up = false;
  std::vector<std::string> labels;
  std::vector<std::array<int, 3>> columns;  ///< of each label
  size_t width = 0;                         ///< columns that it names
  int frame = -1;                           ///< its column; none: rows count from 0
  int first_frame = 0;                      ///< the file's number of our frame 0
  double rate_hz = 0;                       ///< 0: not stated
  double num_rows = std::nan("");           ///< as stated
  std::vector<std::string> notes = {};
};

/// Columns X, Y, Z beside each other; `label_of` names the point of the first, empty: none.
template <class LabelOf>
void FindPoints(const StudioCells& axes, LabelOf&& label_of, StudioHead* head) {
  head->width = axes.size();
  for (size_t c = 0; c + 2 < axes.size(); ++c) {
    if (LowerCase(axes[c]) != "x" || LowerCase(axes[c + 1]) != "y" || LowerCase(axes[c + 2]) != "z") continue;
    const std::string label = label_of(c);
    const int column = static_cast<int>(c);
    if (!label.empty()) head->labels.push_back(label), head->columns.push_back({column, column + 1, column + 2});
  }
}

/// Vicon Nexus, export of ASCII: sections with a title, a rate, labels, axes, units, rows; a blank line ends one.
StudioHead ReadViconHead(StudioLines* lines) {
  StudioHead head;
  bool found = false;
  while (!found && lines->Next()) found = LowerCase(lines->At(0)) == "trajectories";
  if (!found)
    throw FormatError(lines->path(), "",
                      "a file of Vicon without a section `Trajectories`: export the trajectories from Nexus");
  lines->Next();
  head.rate_hz = lines->Number(0);
  lines->Next();
  const StudioCells labels = lines->cells();
  lines->Next();
  const StudioCells axes = lines->cells();
  if (axes.empty() || LowerCase(axes[0]) != "frame") lines->Fail("the line of axes does not begin with `Frame`");
  head.frame = 0, head.first_frame = 1;
  FindPoints(
      axes, [&](size_t c) { return c < labels.size() ? labels[c] : std::string(); }, &head);
  lines->Next();
  std::set<std::string> units;
  for (const auto& columns : head.columns) units.insert(LowerCase(lines->At(columns[0])));
  if (units.size() > 1) lines->Fail("columns have different units: " + SomeOf({units.begin(), units.end()}));
  if (!units.empty()) head.unit = *units.begin();
  return head;
}

/// OptiTrack Motive: names and values in the first line, then rows Type, Name, ID, (Parent,) kind and `Frame, Time, X, …`.
StudioHead ReadMotiveHead(StudioLines* lines) {
  StudioHead head;
  head.y_up = true, head.frame = 0;
  lines->Next();
  for (size_t c = 0; c + 1 < lines->cells().size(); c += 2) {
    const std::string key = LowerCase(lines->cells()[c]), &value = lines->cells()[c + 1];
    if (key == "length units") head.unit = LowerCase(value);
    if (key == "export frame rate") head.rate_hz = ReadNumberCell(value).value;
    if (key == "total exported frames") head.num_rows = ReadNumberCell(value).value;
  }
  std::vector<StudioCells> rows;
  while (lines->Next() && LowerCase(lines->At(0)) != "frame") {
    if (!lines->IsBlank()) rows.push_back(lines->cells());
    if (rows.size() > 10) lines->Fail("no line of columns that begins with `Frame`");
  }
  if (rows.size() < 3) lines->Fail("the lines with the types and names of the columns are not there");
  const auto at = [&](size_t row, size_t c) { return c < rows[row].size() ? rows[row][c] : std::string(); };
  // The same point stands there as a marker, as a rigid body holds it, and perhaps as a bone: measured ones first.
  std::set<std::string> types(rows[0].begin(), rows[0].end());
  std::string kept;
  for (const char* type : {"Marker", "Rigid Body Marker", "Bone Marker", "Bone", "Rigid Body"}) {
    if (kept.empty() && types.count(type) > 0) kept = type;
  }
  const auto label_of = [&](size_t c) { return at(0, c) == kept && at(rows.size() - 1, c) == "Position" ? at(1, c) : ""; };
  FindPoints(lines->cells(), label_of, &head);
  for (const std::string& other : {std::string(), std::string("Type"), kept}) types.erase(other);
  if (!types.empty())
    head.notes.push_back("its columns of type " + SomeOf({types.begin(), types.end()}) + " are not read, those of type " +
                         kept + " are");
  return head;
}

/// Qualisys QTM: a key and its values a line, MARKER_NAMES the last but one or two; mm.
StudioHead ReadQualisysHead(StudioLines* lines) {
  StudioHead head;
  head.unit = "mm";
  while (head.labels.empty() && lines->Next()) {
    const std::string key = lines->At(0);
    if (key == "NO_OF_FRAMES") head.num_rows = lines->Number(1);
    if (key == "FREQUENCY") head.rate_hz = lines->Number(1);
    if (key == "DATA_INCLUDED" && lines->At(1) != "3D")
      lines->Fail("DATA_INCLUDED is `" + lines->At(1) + "`: export the 3D data from QTM");
    if (key == "MARKER_NAMES") head.labels.assign(lines->cells().begin() + 1, lines->cells().end());
  }
  while (!head.labels.empty() && head.labels.back().empty()) head.labels.pop_back();
  if (head.labels.empty()) throw FormatError(lines->path(), "", "has no line MARKER_NAMES: no 3D data of Qualisys");
  head.notes.push_back("states no unit; Qualisys writes mm");
  return head;
}

/// Finds the columns of Qualisys by its first row of numbers or the titles above it; true where the row is none of numbers.
bool IsTitleOfQualisys(const StudioLines& lines, StudioHead* head) {
  if (lines.At(0).find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ_") == std::string::npos && !lines.At(0).empty()) return true;
  if (!head->columns.empty()) return false;
  const size_t numbers = 3 * head->labels.size();
  size_t count = lines.cells().size();
  if (count == numbers + 1 || count == numbers + 3) --count;  // a tab at the end
  const bool titles = LowerCase(lines.At(0)) == "frame";
  const bool framed = titles || count == numbers + 2;
  if (!framed && count != numbers)
    lines.Fail(std::to_string(count) + " columns for " + std::to_string(numbers / 3) + " markers");
  head->width = numbers + (framed ? 2 : 0);
  head->frame = framed ? 0 : -1, head->first_frame = framed ? 1 : 0;
  for (size_t m = 0; m < head->labels.size(); ++m) {
    const int first = static_cast<int>(3 * m) + (framed ? 2 : 0);
    head->columns.push_back({first, first + 1, first + 2});
  }
  return titles;
}

void ReadStudioRow(const StudioLines& lines, const StudioHead& head, const std::vector<MarkerLabel>& names, int row,
                   double metres, MarkerFile* file) {
  const std::optional<int> stated = head.frame < 0 ? row : WholeNumberCell(lines.At(head.frame));
  if (!stated) lines.Fail("`" + lines.At(head.frame).substr(0, 40) + "` is not a frame number");
  for (size_t c = head.width; c < lines.cells().size(); ++c) {
    if (!lines.cells()[c].empty())
      lines.Fail("more columns than the header names; are its commas decimal points? Save the table with decimal points");
  }
  for (size_t m = 0; m < names.size(); ++m) {
    Eigen::Vector3d x;
    for (int k = 0; k < 3; ++k) x[k] = metres * lines.Number(head.columns[m][static_cast<size_t>(k)]);
    if (head.y_up) x = WorldFromAxes(x, "y");
    AddMarkerRow(*stated - head.first_frame, names[m].person, names[m].name, x, &file->pose);
  }
}

MarkerFile ReadStudioRows(StudioHead head, bool qualisys, StudioLines* lines, const std::string& unit) {
  if (!qualisys && head.labels.empty()) throw FormatError(lines->path(), "", "its header names no column X of a point");
  MarkerFile file;
  file.pose.skeleton = "points", file.y_up = head.y_up;
  file.unit = UnitOrAsk(unit, head.unit, lines->path());
  file.notes = head.notes;
  if (head.rate_hz > 0) file.pose.frame_rate_hz = head.rate_hz;
  const std::vector<MarkerLabel> names = SplitLabels(head.labels);
  int rows = 0;
  while (lines->Next()) {
    if (lines->IsBlank()) {
      if (rows > 0 && !qualisys) break;  // Vicon's next section
      continue;
    }
    if (qualisys && rows == 0 && IsTitleOfQualisys(*lines, &head)) continue;
    if (rows == 0 && lines->At(head.frame) == "0") head.first_frame = 0;
    ReadStudioRow(*lines, head, names, rows++, MetresPerUnit(file.unit).value_or(1), &file);
  }
  if (rows == 0) throw FormatError(lines->path(), "", "no frames");
  if (std::isfinite(head.num_rows) && head.num_rows != rows)
    file.notes.push_back(Format("its header states %.0f frames, %d are there", head.num_rows, rows) +
                         (head.num_rows > rows ? "; was it cut off?" : ""));
  SortByFrame(lines->path(), &file.pose);
  return file;
}

}  // namespace

bool IsStudioTable(std::string_view text) {
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  const size_t begin = std::min(text.find_first_not_of("\" \r\n"), text.size());
  const std::string word(text.substr(begin, text.find_first_of(",\"\r\n", begin) - begin));
  for (const char* title : {"Trajectories", "Joints", "Model Outputs", "Segments", "Devices", "Format Version"}) {
    if (word == title) return true;
  }
  return false;
}

MarkerFile ReadStudioTable(const std::string& path, const std::string& unit) {
  const std::string text = ReadFile(path);
  StudioLines lines(path, text, ',');
  const bool motive = text.substr(0, 40).find("Format Version") != std::string::npos;
  return ReadStudioRows(motive ? ReadMotiveHead(&lines) : ReadViconHead(&lines), false, &lines, unit);
}

MarkerFile ReadTsvMarkers(const std::string& path, const std::string& unit) {
  const std::string text = ReadFile(path);
  StudioLines lines(path, text, '\t');
  return ReadStudioRows(ReadQualisysHead(&lines), true, &lines, unit);
}

}  // namespace mvstudio::dataset::internal
