#include <algorithm>
#include <cctype>
#include <filesystem>
#include <optional>
#include <set>

#include "core/csv.h"
#include "core/disk/files.h"
#include "core/disk/npy.h"
#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "dataset/pose/marker_formats.h"
#include "dataset/pose/marker_programs.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::dataset::internal {
namespace {

namespace fs = std::filesystem;

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

/// Files of the folder with that end, sorted; none where it is no folder.
std::vector<std::string> FilesEnding(const fs::path& folder, std::string_view end) {
  constexpr size_t kMostFiles = 100'000;
  std::vector<std::string> paths;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), last; !error && entry != last && paths.size() < kMostFiles;
       entry.increment(error)) {
    std::error_code ignored;
    if (EndsWith(entry->path().filename().string(), end) && entry->is_regular_file(ignored)) paths.push_back(entry->path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

/// Points that a table of FreeMoCap names, in its order: a row per frame, or a row per point.
std::vector<std::string> NamesInTable(const std::string& path) {
  const std::string text = ReadFile(path);
  CsvReader csv(path, text);
  std::vector<std::string> names;
  if (!csv.NextLine()) return names;
  const std::vector<std::string> header(csv.Cells().begin(), csv.Cells().end());
  const auto keypoint = std::find(header.begin(), header.end(), "keypoint");
  if (keypoint == header.end()) {
    for (const ColumnTriple& triple : FindTriples(header, path)) names.push_back(FreeMoCapJoint(triple.name));
    return names;
  }
  std::set<std::string> seen;
  while (csv.NextLine()) {
    csv.RequireCells(header.size());
    const std::string name(csv.Cells()[static_cast<size_t>(keypoint - header.begin())]);
    if (!seen.insert(name).second) break;  // the second frame
    names.push_back(name);
  }
  return names;
}

/// Tables of the parts, which an array of all points has in this order.
std::vector<std::string> NamesInParts(const fs::path& folder) {
  std::vector<std::string> names;
  for (const char* part : {"_body_3d_xyz.csv", "_right_hand_3d_xyz.csv", "_left_hand_3d_xyz.csv", "_face_3d_xyz.csv"}) {
    const std::vector<std::string> tables = FilesEnding(folder, part);
    if (tables.size() > 1) return {};  // of several programs
    for (const std::string& table : tables) {
      for (std::string& name : NamesInTable(table)) names.push_back(std::move(name));
    }
  }
  return names;
}

std::vector<std::string> NamesOfArray(const fs::path& path, size_t count, std::vector<std::string>* notes) {
  const fs::path table = fs::path(path).replace_extension(".csv");
  if (fs::is_regular_file(table)) {
    std::vector<std::string> names = NamesInTable(table);
    if (names.size() == count) return names;
    throw FormatError(path, "",
                      Format("has %zu points, and %s beside it names %zu", count, table.filename().c_str(), names.size()));
  }
  for (const fs::path& folder : {path.parent_path(), path.parent_path().parent_path()}) {  // output_data/raw_data/ has none
    std::vector<std::string> names = NamesInParts(folder);
    if (names.size() == count) return names;
  }
  const geometry::Skeleton* mediapipe = geometry::FindSkeleton("mediapipe33");
  if (mediapipe && LowerCase(path.filename()).find("mediapipe") != std::string::npos && mediapipe->joints.size() == count)
    return mediapipe->joints;
  notes->push_back("nothing beside it names its points (a .csv of the same name): they are called point_1, point_2, …");
  std::vector<std::string> names;
  for (size_t i = 1; i <= count; ++i) names.push_back("point_" + std::to_string(i));
  return names;
}

/// What config.yaml of a project of DeepLabCut calls its 3D results by; nothing where it is none.
std::optional<std::string> ScorerOf3d(const fs::path& folder) {
  std::error_code error;
  constexpr std::string_view kKey = "scorername_3d:";
  if (!fs::is_regular_file(folder / "config.yaml", error)) return std::nullopt;
  const std::string text = ReadFile(folder / "config.yaml");
  const size_t at = text.find(kKey);
  if (at == std::string::npos) return std::nullopt;
  const size_t begin = at + kKey.size(), end = std::min({text.find('\n', begin), text.find('#', begin), text.size()});
  std::string name = text.substr(begin, end - begin);
  const auto no_part = [](unsigned char c) { return std::isspace(c) || c == '\'' || c == '"'; };
  name.erase(std::remove_if(name.begin(), name.end(), no_part), name.end());
  return name.empty() ? std::string("DLC_3D") : name;
}

std::string FindDeepLabCut3d(const fs::path& folder) {
  const std::string scorer = ScorerOf3d(folder).value_or("DLC_3D");
  for (const fs::path& place : {folder, folder / "videos"}) {
    for (const char* extension : {".h5", ".csv"}) {
      const std::vector<std::string> files = FilesEnding(place, "_" + scorer + extension);
      if (files.size() == 1) return files[0];
      if (files.size() > 1) throw FormatError(folder, "", "holds several results of DeepLabCut; give one: " + SomeOf(files));
    }
  }
  return "";
}

}  // namespace

const char kFreeMoCapAxes[] = "its axes are kept, z as up: FreeMoCap states no axis (mvstudio markers: option 'up')";

std::string FreeMoCapJoint(const std::string& column) { return column.rfind("body_", 0) == 0 ? column.substr(5) : column; }

std::string FreeMoCapJoint(std::string_view model, std::string_view keypoint) {
  const size_t at = model.find_first_of("_.");
  const std::string part(at == std::string_view::npos ? "body" : model.substr(at + 1)), point(keypoint);
  if (part == "body") return point;
  if (part != "hand") return part + "_" + point;
  const size_t side = point.find('_');  // `left_0003` of the model mediapipe_hand
  return side == std::string::npos ? "hand_" + point : point.substr(0, side) + "_hand" + point.substr(side);
}

double FreeMoCapRate(const std::vector<std::pair<int, double>>& times, std::vector<std::string>* notes) {
  std::vector<std::pair<int, double>> in_seconds = times;
  for (const auto& [word, seconds] : {std::pair("seconds", 1.), {"milliseconds", 1e-3}, {"microseconds", 1e-6}, {"ns", 1e-9}}) {
    for (size_t i = 0; i < times.size(); ++i) in_seconds[i].second = seconds * times[i].second;
    std::vector<std::string> found;
    const double rate_hz = RateOf(in_seconds, &found);
    if (!(rate_hz >= 1 && rate_hz < 1000)) continue;
    notes->insert(notes->end(), found.begin(), found.end());
    notes->push_back(Format("its time stamps state no unit: as %s they are %.4g frames a second", word, rate_hz));
    return rate_hz;
  }
  return 0;
}

MarkerFile ReadNpyMarkers(const std::string& path, const std::string& unit) {
  const NpyArray array = ReadNpy(path);
  if (array.shape.size() != 3 || array.shape[2] != 3)
    throw FormatError(path, "", "holds no 3D points: FreeMoCap's arrays of them have the shape (frames, points, 3)");
  MarkerFile file;
  file.pose.skeleton = "points", file.y_up = false;
  file.unit = UnitOrAsk(unit, "", path);
  const size_t count = static_cast<size_t>(array.shape[1]);
  const std::vector<std::string> names = NamesOfArray(path, count, &file.notes);
  const double metres = MetresPerUnit(file.unit).value_or(1);
  for (size_t i = 0; i < static_cast<size_t>(array.shape[0]) * count; ++i) {
    const Eigen::Vector3d x(array.values[3 * i], array.values[3 * i + 1], array.values[3 * i + 2]);
    AddMarkerRow(static_cast<int>(i / count), 0, names[i % count], metres * x, &file.pose);
  }
  if (file.pose.rows.empty()) throw FormatError(path, "", "holds no frames");
  file.notes.push_back(kFreeMoCapAxes);
  SortByFrame(path, &file.pose);
  return file;
}

std::string FindProgramPoints(const std::string& folder) {
  const fs::path root(folder), output = root / "output_data";
  for (const auto& [place, end] : {std::pair(root, "_by_trajectory.csv"),
                                   {output, "freemocap_data_by_frame.csv"},
                                   {root, "freemocap_data_by_frame.csv"},
                                   {root, "_by_frame.csv"},
                                   {output, "_body_3d_xyz.csv"},
                                   {root, "_body_3d_xyz.csv"},
                                   {output, "_body_3d_xyz.npy"},
                                   {root, "_body_3d_xyz.npy"}}) {
    const std::vector<std::string> files = FilesEnding(place, end);
    if (!files.empty()) return files[0];
  }
  return FindDeepLabCut3d(root);
}

}  // namespace mvstudio::dataset::internal
