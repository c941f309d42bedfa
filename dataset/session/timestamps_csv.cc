#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <map>
#include <optional>
#include <string_view>

#include "core/csv.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/json/json_file.h"
#include "dataset/session/session_scan.h"
#include "dataset/session/timeline_source.h"

namespace mvstudio::dataset {
namespace {

constexpr int64_t kMaxBytes = int64_t{1} << 30;

/// Seconds a unit of a column called `name`; 0 when it is no time.
double SecondsOf(const std::string& name) {
  for (const char* stem : {"frame_time", "timestamp", "time"}) {
    const std::string rest = name.rfind(stem, 0) == 0 ? name.substr(std::string(stem).size()) : "-";
    if (rest.empty() || rest == "_s") return 1;
    if (rest == "_ms") return 1e-3;
    if (rest == "_us") return 1e-6;
    if (rest == "_ns") return 1e-9;
  }
  return 0;
}

struct Columns {
  size_t camera = SIZE_MAX, frame = SIZE_MAX, time = SIZE_MAX;
  double seconds = 1;
  std::string time_name;

  explicit Columns(CsvReader* csv) {
    const std::vector<std::string_view>& header = csv->Cells();
    for (size_t i = 0; i < header.size(); ++i) {
      std::string name(header[i]);
      std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
      if (name == "camera" || name == "cam" || name == "cam_id" || name == "camera_id" || name == "port") camera = i;
      if (name == "frame" || name == "frame_index" || name == "frame_idx") frame = i;
      if (SecondsOf(name) > 0 && time == SIZE_MAX) time = i, seconds = SecondsOf(name), time_name = name;
    }
    if (camera == SIZE_MAX) csv->Fail("no column of cameras: camera, cam, cam_id, camera_id or port");
    if (time == SIZE_MAX) {
      csv->Fail("no column of times: time, timestamp or frame_time, with _ms, _us or _ns if not seconds");
    }
  }

  bool states_unit() const { return time_name.find_last_of('_') != std::string::npos && time_name != "frame_time"; }

  /// Cells that a row must have.
  size_t needed() const { return 1 + std::max(time, frame == SIZE_MAX ? camera : std::max(camera, frame)); }
};

std::optional<long double> Number(const std::string& text) {
  char* end = nullptr;
  const long double value = std::strtold(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// Seconds since 1970 of `2024-05-01T12:00:04.999946`, with a blank for the T, and perhaps `Z` or `+02:00` behind it.
std::optional<long double> IsoTime(const std::string& text) {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, used = 0;
  const bool dated = std::sscanf(text.c_str(), "%4d-%2d-%2d%*1[T ]%2d:%2d:%n", &year, &month, &day, &hour, &minute, &used) == 5;
  if (!dated || used == 0 || month < 1 || month > 12 || day < 1 || day > 31 || hour > 23 || minute > 59) return std::nullopt;
  const size_t end = std::min(text.find_first_not_of("0123456789.", static_cast<size_t>(used)), text.size());
  const auto seconds = Number(text.substr(static_cast<size_t>(used), end - static_cast<size_t>(used)));
  if (!seconds || *seconds >= 61) return std::nullopt;
  const std::string zone = text.substr(end);
  int east_hour = 0, east_minute = 0;
  if (!zone.empty() && zone != "Z" && std::sscanf(zone.c_str(), "%3d:%2d", &east_hour, &east_minute) != 2) return std::nullopt;
  const int east = 60 * east_hour + (zone[0] == '-' ? -east_minute : east_minute);
  // Days by the count of years that begin in March.
  const int y = year - (month <= 2), m = (month + 9) % 12;
  const long long days = 365LL * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day - 719469;
  return 60.0L * (1440.0L * days + 60 * hour + minute - east) + *seconds;
}

std::optional<int64_t> NumberIn(const std::string& name) {
  const auto last = name.find_last_of("0123456789");
  if (last == std::string::npos) return std::nullopt;
  const auto before = name.find_last_not_of("0123456789", last);
  const std::string digits = name.substr(before + 1, last - before);
  return digits.size() > 9 ? std::nullopt : std::optional<int64_t>(std::stoll(digits));
}

/// Position of the camera that a table calls `id`; -1: none, or several by number.
int Match(const std::string& id, const std::vector<SessionCamera>& cameras) {
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].name == id || (!cameras[i].serial.empty() && cameras[i].serial == id)) return static_cast<int>(i);
  }
  if (id.empty() || id.find_first_not_of("0123456789") != std::string::npos) return -1;
  int found = -1;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (!cameras[i].serial.empty() || NumberIn(cameras[i].name) != NumberIn(id)) continue;
    if (found >= 0) return -1;
    found = static_cast<int>(i);
  }
  return found;
}

using Rows = std::vector<std::pair<std::optional<int64_t>, double>>;  // frame, seconds

std::optional<int64_t> ReadFrame(const CsvReader& csv, const std::string& cell) {
  const auto value = Number(cell);
  if (!value || *value < 0 || *value > 1e12L || *value != std::floor(*value)) csv.Fail("the frame is not a whole number");
  return static_cast<int64_t>(*value);
}

using RowsByCamera = std::map<std::string, Rows>;

/// The positive steps of times, added to `steps`.
void AddSteps(std::vector<double> times, std::vector<double>* steps) {
  std::sort(times.begin(), times.end());
  for (size_t i = 1; i < times.size(); ++i) {
    if (times[i] > times[i - 1]) steps->push_back(times[i] - times[i - 1]);
  }
}

/// 0: there are none.
double MedianOfSteps(std::vector<double> steps) {
  if (steps.empty()) return 0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

/// The median step of all cameras' times; 0: there is none.
double MedianStep(const RowsByCamera& cameras) {
  std::vector<double> steps;
  for (const auto& [name, rows] : cameras) {
    std::vector<double> times;
    for (const auto& [frame, time] : rows) times.push_back(time);
    AddSteps(std::move(times), &steps);
  }
  return MedianOfSteps(std::move(steps));
}

/// The same of the videos, seconds; 0: there are none. Images have no times of their own.
double StepOfVideos(const std::vector<CameraTimes>& cameras) {
  std::vector<double> steps;
  for (const CameraTimes& camera : cameras) {
    std::vector<double> times;
    for (const double time : camera.time_s) {
      if (std::isfinite(time)) times.push_back(time);
    }
    if (IsVideoFile(camera.source)) AddSteps(std::move(times), &steps);
  }
  return MedianOfSteps(std::move(steps));
}

struct TimeUnit {
  const char* name;
  double seconds;
};
constexpr TimeUnit kTimeUnits[] = {{"s", 1}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}};

/// The unit in which times `step` apart are about as far apart as the videos' frames; else seconds up to the slowest
/// time-lapse, and beyond it the unit that makes 1 to 1000 frames a second. Null: two units make a rate that cameras have.
const TimeUnit* UnitOfStep(double step, double video_step) {
  constexpr double kAbout = 3, kSlowestLapse = 10, kSlowest = 1, kFastest = 2000;  // seconds a frame, frames a second
  for (const TimeUnit& unit : kTimeUnits) {
    const double ratio = video_step > 0 ? step * unit.seconds / video_step : 0;
    if (ratio > 1 / kAbout && ratio < kAbout) return &unit;
  }
  if (step <= kSlowestLapse) return &kTimeUnits[0];
  for (const TimeUnit& unit : kTimeUnits) {
    if (step * unit.seconds > kSlowest) continue;
    const bool finer_too = &unit != std::end(kTimeUnits) - 1 && step * unit.seconds * 1e-3 * kFastest >= 1;
    return finer_too ? nullptr : &unit;
  }
  return &kTimeUnits[0];
}

/// Times whose column names no unit. Returns what is to be said about it; throws FormatError where it cannot be told.
std::string FindUnit(const std::string& path, const std::string& column, double video_step, RowsByCamera* cameras) {
  constexpr double kUsual = 1.5;  // seconds a frame
  const double step = MedianStep(*cameras);
  if (step <= 0) return "";
  const TimeUnit* const unit = UnitOfStep(step, video_step);
  if (!unit) {
    throw FormatError(path, "column `" + column + "`",
                      "names no unit, and its times are " + Format("%.4g", step) +
                          " apart: several units make a frame rate that cameras have; name the column time_s, time_ms or "
                          "time_us");
  }
  if (unit->seconds == 1 && step < kUsual) return "";
  for (auto& [name, rows] : *cameras) {
    for (auto& [frame, time] : rows) time *= unit->seconds;
  }
  return "the column `" + column + "` of times names no unit: taken as " + unit->name + ", which makes " +
         Format("%.4g", 1 / (step * unit->seconds)) + " frames a second; call it " +
         (unit->seconds == 1 ? "time_ms if it holds milliseconds" : "time_s if it holds seconds");
}

/// Camera -> its rows.
RowsByCamera ReadRows(const std::string& path, const std::vector<SessionCamera>& cameras, double video_step,
                      std::vector<std::string>* notes) {
  const std::string text = internal::ReadTextFile(path, kMaxBytes);
  CsvReader csv(path, text);
  if (!csv.NextLine()) throw FormatError(path, "", "the file is empty");
  const Columns columns(&csv);
  RowsByCamera rows;
  bool dated = false;
  std::map<std::string, int> known;
  while (csv.NextLine()) {
    const std::vector<std::string_view>& cells = csv.Cells();
    if (cells.size() < columns.needed()) csv.RequireCells(columns.needed());
    const auto is_new = known.emplace(cells[columns.camera], 0);
    if (is_new.second) is_new.first->second = Match(is_new.first->first, cameras);
    if (is_new.first->second < 0) continue;
    const std::string cell(cells[columns.time]);
    auto time = Number(cell);
    if (!time && columns.seconds == 1) {
      time = IsoTime(cell);
      dated |= time.has_value();
    }
    if (!time) csv.Fail("the time is not a number: " + internal::Quoted(cell) + DecimalCommaHint(cell));
    std::optional<int64_t> frame;
    if (columns.frame != SIZE_MAX) frame = ReadFrame(csv, std::string(cells[columns.frame]));
    rows[cameras[static_cast<size_t>(is_new.first->second)].name].emplace_back(frame,
                                                                               static_cast<double>(*time * columns.seconds));
  }
  const std::string found = columns.states_unit() || dated ? "" : FindUnit(path, columns.time_name, video_step, &rows);
  if (!found.empty()) notes->push_back(found);
  return rows;
}

/// Recorders number on when they begin to write late: as many rows as frames, in order of time as of number, are the frames.
bool NumbersGoOn(const Rows& rows, const CameraTimes& times) {
  if (rows.size() != times.frame.size() || *rows.back().first <= times.frame.back()) return false;
  return std::adjacent_find(rows.begin(), rows.end(), [](const auto& a, const auto& b) {
           return *a.first == *b.first || a.second > b.second;
         }) == rows.end();
}

/// Returns what is to be said about it, empty mostly.
std::string Give(const std::string& path, Rows rows, CameraTimes* times) {
  std::sort(rows.begin(), rows.end());
  const auto fail = [&](const std::string& what) { throw FormatError(path, "camera " + times->camera, what); };
  std::fill(times->time_s.begin(), times->time_s.end(), std::nan(""));
  times->origin_s.reset();
  if (!rows[0].first) {
    if (rows.size() != times->frame.size()) {
      fail("holds " + std::to_string(rows.size()) + " times, the footage " + std::to_string(times->frame.size()) +
           " frames; a column frame_index would tell which are missing");
    }
    for (size_t i = 0; i < rows.size(); ++i) times->time_s[i] = rows[i].second;
    return "";
  }
  if (NumbersGoOn(rows, *times)) {
    for (size_t i = 0; i < rows.size(); ++i) times->time_s[i] = rows[i].second;
    return "camera " + times->camera + ": the table numbers its frames " + std::to_string(*rows.front().first) + " to " +
           std::to_string(*rows.back().first) + ", as many as the footage has: they are taken in order";
  }
  for (size_t i = 0; i < rows.size(); ++i) {
    if (i > 0 && *rows[i].first == *rows[i - 1].first) fail("frame " + std::to_string(*rows[i].first) + " is there twice");
    const auto at = std::lower_bound(times->frame.begin(), times->frame.end(), *rows[i].first);
    if (at == times->frame.end() || *at != *rows[i].first) {
      fail("names frame " + std::to_string(*rows[i].first) + ", which the footage (" + std::to_string(times->frame.size()) +
           " frames) does not have");
    }
    times->time_s[static_cast<size_t>(at - times->frame.begin())] = rows[i].second;
  }
  return "";
}

}  // namespace

std::vector<std::string> ReadTimestamps(const std::string& path, const std::vector<SessionCamera>& cameras,
                                        std::vector<CameraTimes>* times) {
  std::vector<std::string> notes;
  const RowsByCamera rows = ReadRows(path, cameras, StepOfVideos(*times), &notes);
  for (CameraTimes& camera : *times) {
    const auto found = rows.find(camera.camera);
    if (found == rows.end()) {
      throw FormatError(path, "camera " + camera.camera, "has no rows; give it the id it has here as serial in mvstudio.toml");
    }
    const std::string note = Give(path, found->second, &camera);
    if (!note.empty()) notes.push_back(note);
  }
  return notes;
}

}  // namespace mvstudio::dataset
