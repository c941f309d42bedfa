#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "core/csv.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "core/text/number_cell.h"
#include "core/text/row_times.h"
#include "dataset/pose/marker_formats.h"
#include "dataset/pose/marker_programs.h"

namespace mvstudio::dataset::internal {
namespace {

/// Names of columns that count or time the rows.
int FindColumn(const std::vector<std::string>& header, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    for (size_t c = 0; c < header.size(); ++c) {
      if (LowerCase(header[c]) == name) return static_cast<int>(c);
    }
  }
  return -1;
}

std::vector<std::string> Texts(const std::vector<std::string_view>& cells) { return {cells.begin(), cells.end()}; }

int FrameIn(const CsvReader& csv, std::string_view cell) {
  int frame = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), frame);
  if (error == std::errc() && end == cell.data() + cell.size()) return frame;  // time steps before the first are negative
  std::string why;
  const int64_t read = ReadFrameNumber(cell, 999'999'999, &why);
  if (read < 0) csv.Fail("the frame " + why);
  return static_cast<int>(read);
}

double NumberIn(const CsvReader& csv, std::string_view cell) {
  const NumberCell number = ReadNumberCell(cell);
  if (number.kind == NumberCell::Kind::kOther) csv.Fail("`" + std::string(cell) + "` is not a number" + DecimalCommaHint(cell));
  return number.value;
}

/// FreeMoCap's time stamps have no unit; those of others are seconds.
constexpr char kFreeMoCapClock[] = "timestamp_by_camera";

/// A row per point.
struct LongColumns {
  int frame, person, joint, x[3], sigma, source, status, time;
  int model, trajectory, stamp;  ///< FreeMoCap's
  std::string unit;

  explicit LongColumns(const std::vector<std::string>& header) {
    frame = FindColumn(header, {"frame"}), person = FindColumn(header, {"person"});
    joint = FindColumn(header, {"joint", "marker", "keypoint", "bodypart", "point"});
    time = FindColumn(header, {"time_s", "time"}), sigma = FindColumn(header, {"sigma_m"});
    source = FindColumn(header, {"source"}), status = FindColumn(header, {"status"});
    model = FindColumn(header, {"model"}), trajectory = FindColumn(header, {"trajectory"});
    stamp = FindColumn(header, {kFreeMoCapClock}) < 0 ? -1 : FindColumn(header, {"timestamp"});
    for (const char* suffix : {"", "_m", "_cm", "_mm", "_in"}) {
      for (int k = 0; k < 3; ++k) x[k] = FindColumn(header, {(std::string(1, static_cast<char>('x' + k)) + suffix).c_str()});
      if (x[0] >= 0 && x[1] >= 0 && x[2] >= 0) {
        unit = suffix[0] ? suffix + 1 : "";
        break;
      }
    }
  }
  bool IsLong() const { return joint >= 0 && frame >= 0 && x[0] >= 0 && x[1] >= 0 && x[2] >= 0; }
};

/// Of the kinds of points that FreeMoCap keeps in one table, those that were triangulated.
constexpr char kTriangulated[] = "3d_xyz";

void ReadLongRows(CsvReader* csv, const LongColumns& columns, size_t width, double metres, MarkerFile* file) {
  std::vector<std::pair<int, double>> times, stamps;
  std::set<std::string> others;
  while (csv->NextLine()) {
    const std::vector<std::string_view> cells = csv->Cells();
    csv->RequireCells(width);
    const int frame = FrameIn(*csv, cells[columns.frame]);
    if (columns.trajectory >= 0 && cells[columns.trajectory] != kTriangulated) {
      others.emplace(cells[columns.trajectory]);
      continue;
    }
    const int person = columns.person >= 0 ? FrameIn(*csv, cells[columns.person]) : 0;
    Eigen::Vector3d x;
    for (int k = 0; k < 3; ++k) x[k] = metres * NumberIn(*csv, cells[columns.x[k]]);
    const bool ok = columns.status < 0 || cells[columns.status] == ToString(Status::kOk);
    const std::string_view joint = cells[columns.joint];
    AddMarkerRow(frame, person, columns.model < 0 ? std::string(joint) : FreeMoCapJoint(cells[columns.model], joint),
                 ok ? x : Eigen::Vector3d::Constant(std::nan("")), &file->pose);
    JointRow& row = file->pose.rows.back();
    if (columns.sigma >= 0 && row.status == Status::kOk) {
      const double sigma = NumberIn(*csv, cells[columns.sigma]);
      row.sigma_m = std::isfinite(sigma) ? sigma : 0;
    }
    // Filled positions have no views, as in MarkersOf.
    if (columns.source >= 0 && row.status == Status::kOk) row.num_views = cells[columns.source] == "filled" ? 0 : 1;
    if (columns.time >= 0) times.emplace_back(frame, NumberIn(*csv, cells[columns.time]));
    if (columns.stamp >= 0 && (stamps.empty() || stamps.back().first != frame))
      stamps.emplace_back(frame, ReadNumberCell(cells[columns.stamp]).value);
  }
  file->pose.frame_rate_hz = stamps.empty() ? RateOf(times, &file->notes) : FreeMoCapRate(stamps, &file->notes);
  const std::string rest = SomeOf({others.begin(), others.end()});
  if (file->pose.rows.empty() && !others.empty())
    csv->Fail(std::string("holds no trajectory `") + kTriangulated + "`; there are " + rest);
  if (!others.empty()) file->notes.push_back("its trajectories that are not read: " + rest);
}

/// Columns that no reader of rows per point asks for; those of our own tables say nothing about the points.
void NoteUnread(const std::vector<std::string>& header, const LongColumns& columns, MarkerFile* file) {
  std::vector<std::string> unread;
  for (size_t c = 0; c < header.size(); ++c) {
    const int column = static_cast<int>(c);
    bool used = std::count(columns.x, columns.x + 3, column) > 0;
    for (const int known : {columns.frame, columns.person, columns.joint, columns.sigma, columns.source, columns.status,
                            columns.time, columns.model, columns.trajectory, columns.stamp})
      used = used || known == column;
    const std::string name = LowerCase(header[c]);
    if (!used && name != "num_views" && name != "rms_px" && name != kFreeMoCapClock) unread.push_back(header[c]);
  }
  if (!unread.empty()) file->notes.push_back("its columns that are not read: " + SomeOf(unread));
}

/// Of rows counted from 0; false: they have no times that tell frames, and stay.
bool NumberRowsByTimes(std::vector<std::pair<int, double>>* times, MarkerFile* file) {
  std::vector<double> seconds;
  for (const auto& [row, time] : *times) seconds.push_back(time);
  std::string why;
  const std::optional<RowFrames> found = FramesOfTimes(seconds, &why);
  if (!found) return false;
  for (JointRow& row : file->pose.rows) row.frame = found->frames[static_cast<size_t>(row.frame)];
  for (auto& [row, time] : *times) row = found->frames[static_cast<size_t>(row)];
  return true;
}

void ReadWideRows(CsvReader* csv, const std::vector<std::string>& header, const std::vector<ColumnTriple>& triples,
                  double metres, MarkerFile* file) {
  const int frame_column = FindColumn(header, {"frame", "fnum", "frame#", "frame_number", "frame_idx", "index", ""});
  const bool freemocap = FindColumn(header, {kFreeMoCapClock}) >= 0;
  const int time_column = FindColumn(header, {"time_s", "time", "timestamp", "time (s)"});
  std::vector<std::pair<int, double>> times;
  for (int row = 0; csv->NextLine(); ++row) {
    const std::vector<std::string_view> cells = csv->Cells();
    csv->RequireCells(header.size());
    const int frame = frame_column >= 0 ? FrameIn(*csv, cells[frame_column]) : row;
    for (const ColumnTriple& triple : triples) {
      Eigen::Vector3d x;
      for (int k = 0; k < 3; ++k) x[k] = metres * NumberIn(*csv, cells[triple.columns[k]]);
      AddMarkerRow(frame, 0, freemocap ? FreeMoCapJoint(triple.name) : triple.name, x, &file->pose);
    }
    if (time_column < 0) continue;
    const std::string_view time = cells[time_column];
    times.emplace_back(frame, freemocap ? ReadNumberCell(time).value : NumberIn(*csv, time));  // FreeMoCap's may be a date
  }
  const bool timed = frame_column < 0 && !freemocap && NumberRowsByTimes(&times, file);
  file->pose.frame_rate_hz = freemocap ? FreeMoCapRate(times, &file->notes) : RateOf(times, &file->notes);
  std::vector<std::string> unused;
  for (size_t c = 0; c < header.size(); ++c) {
    bool used = static_cast<int>(c) == frame_column || static_cast<int>(c) == time_column;
    for (const ColumnTriple& triple : triples)
      used = used || std::count(triple.columns, triple.columns + 3, static_cast<int>(c)) > 0;
    if (!used && header[c] != kFreeMoCapClock) unused.push_back(header[c]);
  }
  if (!unused.empty()) file->notes.push_back("its columns without x, y and z of a point are not read: " + SomeOf(unused));
  if (frame_column < 0)
    file->notes.push_back(timed ? "it has no column `frame`; its rows are numbered by their times"
                                : "it has no column `frame`; its rows are counted from 0");
}

/// Storage: "key=value" lines, `endheader`, the labels, the rows.
struct StoHead {
  std::map<std::string, std::string> values;
  std::vector<std::string> labels;
  size_t at = 0;  ///< of the first row
  int line = 0;
};

std::string_view NextLineOf(const std::string& text, size_t* at) {
  const size_t end = std::min(text.find('\n', *at), text.size());
  std::string_view line = std::string_view(text).substr(*at, end - *at);
  *at = std::min(end + 1, text.size());
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

std::vector<std::string> WordsOf(std::string_view line) {
  const bool tabs = line.find('\t') != std::string_view::npos;
  std::vector<std::string> words;
  std::string word;
  const auto push = [&] {
    const size_t begin = word.find_first_not_of(' '), end = word.find_last_not_of(' ');
    if (begin != std::string::npos || tabs)
      words.push_back(begin == std::string::npos ? "" : word.substr(begin, end - begin + 1));
    word.clear();
  };
  for (const char c : line) {
    if (c == '\t' || (!tabs && c == ' '))
      push();
    else
      word += c;
  }
  push();
  while (!words.empty() && words.back().empty()) words.pop_back();
  return words;
}

StoHead ReadStoHead(const std::string& text, const std::string& path) {
  StoHead head;
  bool ended = false;
  while (!ended && head.at < text.size()) {
    const std::string line(NextLineOf(text, &head.at));
    ++head.line;
    ended = LowerCase(line).rfind("endheader", 0) == 0;
    const size_t equals = line.find('=');
    if (!ended && equals != std::string::npos) head.values[LowerCase(line.substr(0, equals))] = line.substr(equals + 1);
  }
  if (!ended) throw FormatError(path, "", "has no line `endheader`: no file of OpenSim's Storage");
  while (head.labels.empty() && head.at < text.size()) head.labels = WordsOf(NextLineOf(text, &head.at)), ++head.line;
  if (head.labels.empty() || LowerCase(head.labels[0]) != "time")
    throw FormatError(path, "line " + std::to_string(head.line), "the first column is not `time`");
  return head;
}

double StoNumber(const std::string& path, int line, const std::string& text) {
  const NumberCell number = ReadNumberCell(text);
  if (number.kind == NumberCell::Kind::kOther)
    throw FormatError(path, "line " + std::to_string(line), "`" + text.substr(0, 40) + "` is not a number");
  return number.value;
}

Eigen::Vector3d StoVector(const std::string& path, int line, const std::string& cell) {
  Eigen::Vector3d x = Eigen::Vector3d::Constant(std::nan(""));
  if (cell.empty()) return x;
  const size_t first = cell.find(','), second = first == std::string::npos ? first : cell.find(',', first + 1);
  if (second == std::string::npos)
    throw FormatError(path, "line " + std::to_string(line), "`" + cell.substr(0, 40) + "` is not x,y,z");
  x << StoNumber(path, line, cell.substr(0, first)), StoNumber(path, line, cell.substr(first + 1, second - first - 1)),
      StoNumber(path, line, cell.substr(second + 1));
  return x;
}

/// Frames follow from the times and the rate: the header's, where the times do not speak against it.
double StoRate(const StoHead& head, const std::vector<double>& times, const std::string& path,
               std::vector<std::string>* notes) {
  const auto stated = head.values.find("datarate");
  const double rate_hz = stated == head.values.end() ? 0 : ReadNumberCell(stated->second).value;
  const double seconds = times.size() < 2 ? 0 : times.back() - times.front();
  std::string why;
  const std::optional<RowFrames> frames = FramesOfTimes(times, &why);  // rows may be missing
  const double of_times_hz = frames ? 1 / frames->step : seconds > 0 ? static_cast<double>(times.size() - 1) / seconds : 0;
  if (!(rate_hz > 0) && !(of_times_hz > 0))
    throw FormatError(path, "", "neither its header (`DataRate=`) nor its times say how many rows a second it has");
  if (!(of_times_hz > 0)) return rate_hz;
  if (!(rate_hz > 0)) return of_times_hz;
  if (std::abs(of_times_hz / rate_hz - 1) <= 0.02) return rate_hz;
  notes->push_back(
      Format("its header states %g rows a second, its times are those of %.4g, which are used", rate_hz, of_times_hz));
  return of_times_hz;
}

/// Counts that the header states, held against the rows.
void CheckSto(const StoHead& head, const std::vector<double>& times, MarkerFile* file) {
  const auto stated = [&](const char* key) {
    const auto found = head.values.find(key);
    return found == head.values.end() ? std::nan("") : ReadNumberCell(found->second).value;
  };
  const auto check = [&](const char* key, const char* what, size_t there) {
    const double count = stated(key);
    if (std::isfinite(count) && count != static_cast<double>(there))
      file->notes.push_back(Format("its header states %g %s, %zu are there", count, what, there) +
                            (count > static_cast<double>(there) ? "; was it cut off?" : ""));
  };
  check("nrows", "rows", times.size()), check("ncolumns", "columns", head.labels.size());
  if (!std::is_sorted(times.begin(), times.end())) file->notes.push_back("its times do not rise from row to row");
}

}  // namespace

MarkerFile ReadCsvMarkers(const std::string& path, const std::string& unit) {
  const std::string text = ReadFile(path);
  if (IsStudioTable(text)) return ReadStudioTable(path, unit);
  if (IsDeepLabCutTable(text)) return ReadDeepLabCutMarkers(path, unit);
  CsvReader csv(path, text);
  if (!csv.NextLine()) throw FormatError(path, "", "is empty");
  const std::vector<std::string> header = Texts(csv.Cells());
  MarkerFile file;
  file.pose.skeleton = "points", file.y_up = false;
  const LongColumns columns(header);
  const std::vector<ColumnTriple> triples = columns.IsLong() ? std::vector<ColumnTriple>() : FindTriples(header, path);
  if (!columns.IsLong() && triples.empty()) {
    throw FormatError(path, "line 1",
                      "no columns of 3D points: a row per point has frame, joint, x_m, y_m, z_m; a row per frame has columns "
                      "such as Nose_x, Nose_y, Nose_z");
  }
  file.unit = UnitOrAsk(unit, columns.IsLong() ? columns.unit : triples[0].unit, path);
  const double metres = MetresPerUnit(file.unit).value_or(1);
  if (columns.IsLong()) NoteUnread(header, columns, &file);
  if (FindColumn(header, {kFreeMoCapClock}) >= 0 || columns.model >= 0) file.notes.push_back(kFreeMoCapAxes);
  if (columns.IsLong())
    ReadLongRows(&csv, columns, header.size(), metres, &file);
  else
    ReadWideRows(&csv, header, triples, metres, &file);
  if (file.pose.rows.empty()) throw FormatError(path, "", "no frames");
  SortByFrame(path, &file.pose);
  return file;
}

MarkerFile ReadStoMarkers(const std::string& path, const std::string& unit) {
  const std::string text = ReadFile(path);
  const StoHead head = ReadStoHead(text, path);
  MarkerFile file;
  file.pose.skeleton = "points", file.y_up = true;
  const auto type = head.values.find("datatype");
  const bool vectors = type != head.values.end() && LowerCase(type->second) == "vec3";
  const std::vector<ColumnTriple> triples = vectors ? std::vector<ColumnTriple>() : FindTriples(head.labels, path);
  if (!vectors && triples.empty())
    throw FormatError(path, "line " + std::to_string(head.line),
                      "no columns of points (DataType=Vec3, or NAME_x, NAME_y, NAME_z); a table of angles has no positions");
  const auto stated = head.values.find("units");
  file.unit = UnitOrAsk(unit, stated == head.values.end() ? "" : stated->second, path);
  const double metres = MetresPerUnit(file.unit).value_or(1);
  std::vector<double> times;
  std::vector<std::vector<Eigen::Vector3d>> rows;
  int line = head.line;
  for (size_t at = head.at; at < text.size();) {
    const std::vector<std::string> cells = WordsOf(NextLineOf(text, &at));
    ++line;
    if (cells.empty()) continue;
    if (cells.size() > head.labels.size())
      throw FormatError(path, "line " + std::to_string(line), "more columns than the header names");
    const auto cell = [&](size_t c) { return c < cells.size() ? cells[c] : std::string(); };
    times.push_back(StoNumber(path, line, cells[0]));
    auto& row = rows.emplace_back();
    for (size_t c = 1; vectors && c < head.labels.size(); ++c) row.push_back(StoVector(path, line, cell(c)));
    for (const ColumnTriple& t : triples) {
      row.emplace_back(StoNumber(path, line, cell(t.columns[0])), StoNumber(path, line, cell(t.columns[1])),
                       StoNumber(path, line, cell(t.columns[2])));
    }
  }
  const double rate_hz = StoRate(head, times, path, &file.notes);
  file.pose.frame_rate_hz = rate_hz;
  CheckSto(head, times, &file);
  for (size_t f = 0; f < rows.size(); ++f) {
    if (!(std::abs(times[f] * rate_hz) < 1e9)) throw FormatError(path, "", "a time is no number, or far beyond a take");
    for (size_t m = 0; m < rows[f].size(); ++m) {
      const Eigen::Vector3d& x = rows[f][m];
      AddMarkerRow(static_cast<int>(std::lround(times[f] * rate_hz)), 0, vectors ? head.labels[m + 1] : triples[m].name,
                   metres * Eigen::Vector3d(x.z(), x.x(), x.y()), &file.pose);
    }
  }
  if (file.pose.rows.empty()) throw FormatError(path, "", "no rows");
  SortByFrame(path, &file.pose);
  return file;
}

}  // namespace mvstudio::dataset::internal
