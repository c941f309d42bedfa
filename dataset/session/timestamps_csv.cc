#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <string_view>

#include "core/csv.h"
#include "core/error.h"
#include "dataset/json/json_file.h"
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

  explicit Columns(CsvReader* csv) {
    const std::vector<std::string_view>& header = csv->Cells();
    for (size_t i = 0; i < header.size(); ++i) {
      std::string name(header[i]);
      std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
      if (name == "camera" || name == "cam" || name == "cam_id" || name == "camera_id" || name == "port") camera = i;
      if (name == "frame" || name == "frame_index" || name == "frame_idx") frame = i;
      if (SecondsOf(name) > 0 && time == SIZE_MAX) time = i, seconds = SecondsOf(name);
    }
    if (camera == SIZE_MAX) csv->Fail("no column of cameras: camera, cam, cam_id, camera_id or port");
    if (time == SIZE_MAX) {
      csv->Fail("no column of times: time, timestamp or frame_time, with _ms, _us or _ns if not seconds");
    }
  }

  /// Cells that a row must have.
  size_t needed() const { return 1 + std::max(time, frame == SIZE_MAX ? camera : std::max(camera, frame)); }
};

std::optional<long double> Number(const std::string& text) {
  char* end = nullptr;
  const long double value = std::strtold(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value)) return std::nullopt;
  return value;
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

/// Camera -> its rows.
std::map<std::string, Rows> ReadRows(const std::string& path, const std::vector<SessionCamera>& cameras) {
  const std::string text = internal::ReadTextFile(path, kMaxBytes);
  CsvReader csv(path, text);
  if (!csv.NextLine()) throw FormatError(path, "", "the file is empty");
  const Columns columns(&csv);
  std::map<std::string, Rows> rows;
  std::map<std::string, int> known;
  while (csv.NextLine()) {
    const std::vector<std::string_view>& cells = csv.Cells();
    if (cells.size() < columns.needed()) csv.RequireCells(columns.needed());
    const auto is_new = known.emplace(cells[columns.camera], 0);
    if (is_new.second) is_new.first->second = Match(is_new.first->first, cameras);
    if (is_new.first->second < 0) continue;
    const std::string cell(cells[columns.time]);
    const auto time = Number(cell);
    if (!time) csv.Fail("the time is not a number: " + internal::Quoted(cell) + DecimalCommaHint(cell));
    std::optional<int64_t> frame;
    if (columns.frame != SIZE_MAX) frame = ReadFrame(csv, std::string(cells[columns.frame]));
    rows[cameras[static_cast<size_t>(is_new.first->second)].name].emplace_back(frame,
                                                                               static_cast<double>(*time * columns.seconds));
  }
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
  const std::map<std::string, Rows> rows = ReadRows(path, cameras);
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
