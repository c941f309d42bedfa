#include "dataset/trackers/tracker_table.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "core/error.h"
#include "core/label.h"
#include "dataset/pose/score_scale.h"

namespace mvstudio::dataset::internal {
namespace {

size_t PlaceOf(const std::string& name, std::vector<std::string>* names) {
  const auto found = std::find(names->begin(), names->end(), name);
  if (found != names->end()) return static_cast<size_t>(found - names->begin());
  names->push_back(name);
  return names->size() - 1;
}

}  // namespace

bool IsCoordinate(const TrackerColumn& column) {
  return column.coord == "x" || column.coord == "y" || column.coord == "likelihood";
}

Keypoint2d ToKeypoint(double x_px, double y_px, double score) {
  constexpr double kFarthestPx = 1e9, kRounding = 1e-6;
  if (!(std::abs(x_px) < kFarthestPx && std::abs(y_px) < kFarthestPx)) return {};
  return {x_px, y_px, std::isnan(score) || std::abs(score - 1) < kRounding ? 1 : score};
}

TrackerTable::TrackerTable(const std::string& path, const std::string& camera, const std::string& program,
                           const std::vector<TrackerColumn>& columns)
    : path_(path), num_columns_(columns.size()) {
  constexpr size_t kMaxColumns = 100'000;
  points_.program = program;
  points_.track.camera = camera, points_.track.every_frame = program == "DeepLabCut";
  if (columns.size() > kMaxColumns) Fail("header", std::to_string(columns.size()) + " columns; refused");
  std::map<std::pair<std::string, std::string>, size_t> known;
  for (size_t c = 0; c < columns.size(); ++c) AddColumn(columns[c], static_cast<int>(c), &known);
  for (const Point& point : table_) {
    if (point.x >= 0 && point.y >= 0) continue;
    Fail("header", "joint `" + points_.joints[point.joint] + "` has no column x or no column y");
  }
  if (table_.empty()) Fail("header", "no column holds x, y of a joint; is it a table of 2D points?");
}

void TrackerTable::AddColumn(const TrackerColumn& column, int index,
                             std::map<std::pair<std::string, std::string>, size_t>* known) {
  if (column.coord == "z") {
    Fail("header",
         "holds x, y, z: 3D points of several cameras together, which `mvstudio markers convert` reads; here give the cameras' "
         "own 2D "
         "files");
  }
  if (!IsCoordinate(column)) return;
  const std::string why = WhyNotALabel(column.joint);
  const std::string why_individual = column.individual.empty() ? "" : WhyNotALabel(column.individual);
  if (!why.empty() || !why_individual.empty()) {
    Fail("header", "a name above column " + std::to_string(index + 1) + " " + (why.empty() ? why_individual : why));
  }
  const auto [entry, is_new] = known->emplace(std::pair(column.individual, column.joint), table_.size());
  if (is_new) {
    table_.push_back({PlaceOf(column.individual, &points_.individuals), PlaceOf(column.joint, &points_.joints)});
  }
  Point& point = table_[entry->second];
  int& place = column.coord == "x" ? point.x : column.coord == "y" ? point.y : point.score;
  if (place >= 0) {
    Fail("header", "two columns hold " + column.coord + " of `" + column.joint + "`; give a file of one scorer");
  }
  place = index;
}

void TrackerTable::Fail(const std::string& place, const std::string& what) const { throw FormatError(path_, place, what); }

void TrackerTable::CountPlaces(size_t people, const std::string& place) {
  constexpr size_t kFreePlaces = 20'000'000, kMaxPlacesPerCell = 100;
  num_cells_ += num_columns_;
  num_places_ += people * points_.joints.size();
  if (num_places_ <= std::max(kFreePlaces, kMaxPlacesPerCell * num_cells_)) return;
  Fail(place, std::to_string(points_.individuals.size()) + " individuals share none of their " +
                  std::to_string(points_.joints.size()) + " joints; refused");
}

void TrackerTable::Add(int frame, const std::vector<double>& row, const std::string& place, bool more) {
  std::vector<Person2d> people(points_.individuals.size());
  const auto at = [&](int column) { return column < 0 ? std::nan("") : row[static_cast<size_t>(column)]; };
  for (const Point& point : table_) {
    const Keypoint2d key = ToKeypoint(at(point.x), at(point.y), at(point.score));
    if (key.score == 0 || (point.score < 0 && ScoreOfUnscored(key.x_px, key.y_px) == 0)) continue;
    std::vector<Keypoint2d>& keypoints = people[point.individual].keypoints;
    keypoints.resize(points_.joints.size());
    keypoints[point.joint] = key;
  }
  people.erase(std::remove_if(people.begin(), people.end(), [](const Person2d& p) { return p.keypoints.empty(); }),
               people.end());
  CountPlaces(people.size(), place);
  const auto [known, is_new] = points_.track.frames.try_emplace(frame);
  if (!is_new && !more)
    Fail(place, "frame " + std::to_string(frame) +
                    " came before; was the file put together from two videos, or has it several people and no column person?");
  std::move(people.begin(), people.end(), std::back_inserter(known->second));
}

TrackedPoints TrackerTable::Finish() {
  if (points_.track.frames.empty()) Fail("", "holds no frame");
  return std::move(points_);
}

}  // namespace mvstudio::dataset::internal
