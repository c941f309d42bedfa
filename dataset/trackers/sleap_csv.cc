#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string_view>

#include "core/csv.h"
#include "core/disk/pieces.h"
#include "core/error.h"
#include "core/label.h"
#include "core/text/number_cell.h"
#include "dataset/pose/pose2d_parse.h"
#include "dataset/trackers/tracker_readers.h"
#include "dataset/trackers/tracker_table.h"

namespace mvstudio::dataset::internal {
namespace {

struct Node {
  int x = -1, y = -1, score = -1;  // columns
};

struct Columns {
  int track = -1, frame = -1;
  size_t width = 0;
  std::vector<std::string> names;
  std::vector<Node> nodes;
};

void AddNode(const CsvReader& csv, std::string_view name, int column, Columns* columns) {
  const size_t dot = name.rfind('.');
  const std::string_view coord = dot == std::string_view::npos ? "" : name.substr(dot + 1);
  const std::string node(name.substr(0, dot));
  if ((coord != "x" && coord != "y" && coord != "score") || node == "instance" || node == "tracking") return;
  const std::string why = WhyNotALabel(node);
  if (!why.empty()) csv.Fail("the name of column " + std::to_string(column + 1) + " " + why);
  const auto known = std::find(columns->names.begin(), columns->names.end(), node);
  const size_t place = static_cast<size_t>(known - columns->names.begin());
  if (known == columns->names.end()) columns->names.push_back(node), columns->nodes.emplace_back();
  Node& entry = columns->nodes[place];
  int& slot = coord == "x" ? entry.x : coord == "y" ? entry.y : entry.score;
  if (slot >= 0) csv.Fail("two columns are called `" + std::string(name) + "`");
  slot = column;
}

Columns ReadColumns(CsvReader* csv) {
  Columns columns;
  const std::vector<std::string_view>& cells = csv->Cells();
  columns.width = cells.size();
  for (size_t c = 0; c < cells.size(); ++c) {
    const int column = static_cast<int>(c);
    if (cells[c] == "track") columns.track = column;
    if (cells[c] == "frame_idx") columns.frame = column;
    AddNode(*csv, cells[c], column, &columns);
  }
  if (columns.track < 0 || columns.frame < 0) csv->Fail("there is no column track or no column frame_idx");
  for (size_t n = 0; n < columns.nodes.size(); ++n) {
    if (columns.nodes[n].x < 0 || columns.nodes[n].y < 0)
      csv->Fail("`" + columns.names[n] + "` has no column .x or no column .y");
  }
  if (columns.nodes.empty()) csv->Fail("no column holds a node's x (NODE.x, NODE.y, NODE.score)");
  return columns;
}

double Number(const CsvReader& csv, const std::vector<std::string_view>& cells, int column) {
  if (column < 0) return std::nan("");
  const std::string_view cell = cells[static_cast<size_t>(column)];
  const NumberCell number = ReadNumberCell(cell);
  if (number.kind != NumberCell::Kind::kOther) return number.value;
  csv.Fail("`" + std::string(cell) + "` is not a number" + DecimalCommaHint(cell));
}

/// Rows by frame, with the place of their track among the individuals.
using Rows = std::map<int, std::vector<std::pair<size_t, Person2d>>>;

void AddRow(CsvReader* csv, const Columns& columns, std::vector<std::string>* individuals, Rows* rows) {
  const std::vector<std::string_view>& cells = csv->Cells();
  csv->RequireCells(columns.width);
  std::string why;
  const int64_t frame = ReadFrameNumber(cells[static_cast<size_t>(columns.frame)], std::numeric_limits<int>::max(), &why);
  if (frame < 0) csv->Fail("`frame_idx` " + why);
  Person2d person;
  person.keypoints.reserve(columns.nodes.size());
  for (const Node& node : columns.nodes) {
    person.keypoints.push_back(
        ToKeypoint(Number(*csv, cells, node.x), Number(*csv, cells, node.y), Number(*csv, cells, node.score)));
  }
  const std::string track(cells[static_cast<size_t>(columns.track)]);
  auto known = std::find(individuals->begin(), individuals->end(), track);
  if (known == individuals->end()) known = individuals->insert(known, track);
  const size_t place = static_cast<size_t>(known - individuals->begin());
  auto& people = (*rows)[static_cast<int>(frame)];
  const bool twice = std::any_of(people.begin(), people.end(), [&](const auto& entry) { return entry.first == place; });
  if (twice && !track.empty())
    csv->Fail("track `" + track + "` has two rows for frame " + std::to_string(static_cast<int>(frame)));
  people.emplace_back(place, std::move(person));
}

bool IsSeen(const Person2d& person) {
  return std::any_of(person.keypoints.begin(), person.keypoints.end(), [](const Keypoint2d& key) { return key.score > 0; });
}

}  // namespace

TrackedPoints ReadSleapCsv(const std::string& path, const std::string& camera) {
  FilePieces pieces(path);
  CsvReader csv(path, [&](std::string* text) { return pieces.Append(text); });
  if (!csv.NextLine()) throw FormatError(path, "", "the file is empty");
  const Columns columns = ReadColumns(&csv);
  TrackedPoints points{"SLEAP", columns.names, {}, {}, {camera, {}}};
  Rows rows;
  Tolerant tolerant(&points.track.skipped);
  while (csv.NextLine()) tolerant.Try([&] { AddRow(&csv, columns, &points.individuals, &rows); });
  tolerant.Finish();
  if (rows.empty()) throw FormatError(path, "", "the table holds no frame");
  for (auto& [frame, people] : rows) {
    std::stable_sort(people.begin(), people.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<Person2d>& kept = points.track.frames[frame];
    for (auto& [place, person] : people) {
      if (IsSeen(person)) kept.push_back(std::move(person));
    }
  }
  return points;
}

}  // namespace mvstudio::dataset::internal
