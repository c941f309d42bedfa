#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string_view>

#include "core/csv.h"
#include "core/disk/pieces.h"
#include "core/error.h"
#include "core/text/number_cell.h"
#include "dataset/pose/pose2d_parse.h"
#include "dataset/trackers/tracker_file.h"
#include "dataset/trackers/tracker_table.h"

/// caliscope, docs of its project on GitHub (mprib/caliscope), "Output Files": one row per camera, time step and point.
namespace mvstudio::dataset {
namespace {

enum Column { kSync, kCamera, kObject, kPoint, kX, kY, kNumColumns };
const std::vector<std::string_view> kNames[kNumColumns] = {
    {"sync_index"}, {"cam_id", "port"}, {"object_id"}, {"keypoint_id", "point_id"}, {"img_loc_x"}, {"img_loc_y"}};

struct Columns {
  int place[kNumColumns] = {};
  size_t width = 0;

  explicit Columns(CsvReader* csv) {
    const std::vector<std::string_view>& cells = csv->Cells();
    width = cells.size();
    for (int c = 0; c < kNumColumns; ++c) {
      place[c] = -1;
      for (const std::string_view name : kNames[c]) {
        const auto found = std::find(cells.begin(), cells.end(), name);
        if (place[c] < 0 && found != cells.end()) place[c] = static_cast<int>(found - cells.begin());
      }
      if (place[c] < 0 && c != kObject) csv->Fail("there is no column `" + std::string(kNames[c].front()) + "`");
    }
  }
};

struct Row {
  int values[kObject + 2] = {};  // kSync, kCamera, kObject, kPoint
  Keypoint2d key;
};

int Number(const CsvReader& csv, std::string_view cell, Column column) {
  std::string why;
  const int64_t value = ReadFrameNumber(cell, 999'999'999, &why);
  if (value < 0) csv.Fail("`" + std::string(kNames[column].front()) + "` " + why);
  return static_cast<int>(value);
}

double Coordinate(const CsvReader& csv, std::string_view cell) {
  const NumberCell number = ReadNumberCell(cell);
  if (number.kind == NumberCell::Kind::kOther) csv.Fail("`" + std::string(cell) + "` is not a number" + DecimalCommaHint(cell));
  return number.value;
}

Row ReadRow(CsvReader* csv, const Columns& columns) {
  const std::vector<std::string_view>& cells = csv->Cells();
  csv->RequireCells(columns.width);
  Row row;
  const auto cell = [&](int c) { return cells[static_cast<size_t>(columns.place[c])]; };
  for (const Column c : {kSync, kCamera, kObject, kPoint}) {
    if (columns.place[c] >= 0) row.values[c] = Number(*csv, cell(c), c);
  }
  row.key = internal::ToKeypoint(Coordinate(*csv, cell(kX)), Coordinate(*csv, cell(kY)), 1);
  return row;
}

std::vector<Row> ReadRows(const std::string& path, std::vector<std::string>* skipped) {
  FilePieces pieces(path);
  CsvReader csv(path, [&](std::string* text) { return pieces.Append(text); });
  if (!csv.NextLine()) throw FormatError(path, "", "the file is empty");
  const Columns columns(&csv);
  internal::Tolerant tolerant(skipped);
  std::vector<Row> rows;
  while (csv.NextLine()) tolerant.Try([&] { rows.push_back(ReadRow(&csv, columns)); });
  tolerant.Finish();
  if (rows.empty()) throw FormatError(path, "", "the table holds no point");
  return rows;
}

/// Joint of each point number.
std::map<int, size_t> JointsOf(const std::vector<Row>& rows, const geometry::Skeleton* skeleton,
                               std::vector<std::string>* names) {
  std::map<int, size_t> joints;
  for (const Row& row : rows) joints[row.values[kPoint]] = 0;
  for (auto entry = joints.begin(); entry != joints.end();) {
    const size_t number = static_cast<size_t>(entry->first);
    if (skeleton && number >= skeleton->joints.size()) {
      entry = joints.erase(entry);
      continue;
    }
    entry->second = skeleton ? number : names->size();
    names->push_back("point_" + std::to_string(number));
    ++entry;
  }
  return joints;
}

}  // namespace

CaliscopePoints ReadCaliscopeCsv(const std::string& path, const geometry::Skeleton* skeleton) {
  constexpr size_t kMaxPlaces = 200'000'000;
  CaliscopePoints points;
  const std::vector<Row> rows = ReadRows(path, &points.set.skipped);
  std::vector<std::string> names;
  const std::map<int, size_t> joints = JointsOf(rows, skeleton, &names);
  points.set.skeleton = skeleton ? *skeleton : geometry::PointsSkeleton(names);
  const size_t count = points.set.skeleton.joints.size();
  std::map<int, std::map<int, std::map<int, Person2d>>> people;  // camera, time step, object
  std::set<std::array<int, 4>> twins;                            // camera, time step, object, point
  size_t places = 0;
  for (const Row& row : rows) {
    const auto joint = joints.find(row.values[kPoint]);
    points.num_beyond += joint == joints.end();
    if (joint == joints.end() || row.key.score == 0) continue;
    Person2d& person = people[row.values[kCamera]][row.values[kSync]][row.values[kObject]];
    places += person.keypoints.empty() ? count : 0;
    if (places > kMaxPlaces) throw FormatError(path, "", std::to_string(count) + " different points; is it the right column?");
    person.keypoints.resize(count);
    Keypoint2d& key = person.keypoints[joint->second];
    if (key.score > 0) twins.insert({row.values[kCamera], row.values[kSync], row.values[kObject], row.values[kPoint]});
    key = row.key;
  }
  for (const auto& [camera, step, object, point] : twins) {
    people[camera][step][object].keypoints[joints.at(point)] = {};
    points.set.skipped.push_back(path + ": camera " + std::to_string(camera) + ", time step " + std::to_string(step) +
                                 ": point " + std::to_string(point) + " stands there twice; neither is used");
  }
  for (auto& [camera, frames] : people) {
    Pose2dTrack& track = points.set.tracks.emplace_back();
    track.camera = "cam_" + std::to_string(camera);
    for (auto& [frame, objects] : frames) {
      for (auto& [object, person] : objects) track.frames[frame].push_back(std::move(person));
    }
  }
  if (people.empty()) throw FormatError(path, "", "no point of the table is a joint of skeleton " + points.set.skeleton.name);
  return points;
}

}  // namespace mvstudio::dataset
