#include "dataset/pose/markers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>
#include <vector>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "core/statistics.h"
#include "core/text/number_cell.h"
#include "dataset/pose/marker_formats.h"
#include "dataset/pose/marker_programs.h"
#include "dataset/pose/pose3d_c3d.h"
#include "dataset/pose/pose3d_trc.h"

namespace mvstudio::dataset {
namespace {

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return lower;
}

std::string ExtensionOf(const std::string& path) { return Lower(std::filesystem::path(path).extension().string()); }

/// Diagonal of the box around a frame's points, metres: the middle one of all frames with two points or more; 0: there is none.
double SpreadOf(const Pose3d& pose) {
  std::map<int, Eigen::AlignedBox3d> boxes;
  for (const JointRow& row : pose.rows) {
    if (row.status == Status::kOk) boxes[row.frame].extend(row.x_in_world);
  }
  std::vector<double> diagonals;
  for (const auto& [frame, box] : boxes) {
    const double diagonal = box.diagonal().norm();
    if (diagonal > 0) diagonals.push_back(diagonal);
  }
  return UpperMedian(std::move(diagonals), 0.0);
}

/// The time steps in which the origin lies among the points that are not there themselves.
std::set<int> FramesAroundOrigin(const Pose3d& pose) {
  std::map<int, Eigen::AlignedBox3d> boxes;
  for (const JointRow& row : pose.rows) {
    if (row.status == Status::kOk && !row.x_in_world.isZero(0)) boxes[row.frame].extend(row.x_in_world);
  }
  std::set<int> frames;
  for (const auto& [frame, box] : boxes) {
    if (box.contains(Eigen::Vector3d(Eigen::Vector3d::Zero()))) frames.insert(frame);
  }
  return frames;
}

/// Markers that are 0 0 0 wherever they have a place, of files of several frames: surveyed points have one, and may have their
/// origin among them. Points relative to one of them, as a skeleton's to its hip, lie around
/// it in every frame: then that is its place.
std::set<std::pair<int, std::string>> AlwaysZero(const Pose3d& pose) {
  std::set<std::pair<int, std::string>> zero, placed;
  for (const JointRow& row : pose.rows) {
    if (row.status == Status::kOk) (row.x_in_world.isZero(0) ? zero : placed).emplace(row.person, row.joint);
  }
  for (const auto& key : placed) zero.erase(key);
  const auto other_frame = [&](const JointRow& row) { return row.frame != pose.rows.front().frame; };
  if (placed.empty() || zero.empty() || std::none_of(pose.rows.begin(), pose.rows.end(), other_frame)) return {};
  const std::set<int> around = FramesAroundOrigin(pose);
  const bool relative = std::all_of(pose.rows.begin(), pose.rows.end(), [&](const JointRow& row) {
    return row.status != Status::kOk || zero.count({row.person, row.joint}) == 0 || around.count(row.frame) > 0;
  });
  return relative ? std::set<std::pair<int, std::string>>() : zero;
}

/// Some programs write 0 0 0 where a marker was not seen. Of one that never comes near the origin, that is no place.
void LeaveOutZeros(MarkerFile* file) {
  const std::set<std::pair<int, std::string>> never = AlwaysZero(file->pose);
  std::set<std::string> names;
  for (JointRow& row : file->pose.rows) {
    if (row.status != Status::kOk || never.count({row.person, row.joint}) == 0) continue;
    row.status = Status::kTooFewViews, names.insert(row.joint);
  }
  if (!names.empty())
    file->notes.push_back("0 0 0 in all frames, which is taken as not seen: " + SomeOf({names.begin(), names.end()}));
  constexpr double kNearM = 0.02;
  std::map<std::pair<int, std::string>, double> nearest;
  for (const JointRow& row : file->pose.rows) {
    if (row.status != Status::kOk || row.x_in_world.isZero(0)) continue;
    const double distance_m = row.x_in_world.norm();
    const auto [known, is_new] = nearest.emplace(std::pair(row.person, row.joint), distance_m);
    if (!is_new) known->second = std::min(known->second, distance_m);
  }
  size_t count = 0;
  for (JointRow& row : file->pose.rows) {
    if (row.status != Status::kOk || !row.x_in_world.isZero(0)) continue;
    const auto known = nearest.find({row.person, row.joint});
    if (known == nearest.end() || known->second < kNearM) continue;
    row.status = Status::kTooFewViews;
    ++count;
  }
  if (count > 0) file->notes.push_back(Format("%zu points are 0 0 0, where their markers never are near: not seen", count));
}

const std::vector<std::string> kPointFiles = {".trc", ".c3d", ".bvh", ".csv", ".tsv", ".sto", ".npz", ".npy", ".h5"};

MarkerFile ReadByExtension(const std::string& path, const std::string& unit) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error) && internal::FindEasyMocapPoints(path) == path)
    return internal::ReadEasyMocapMarkers(path, unit);
  const std::string extension = ExtensionOf(path);
  if (extension == ".c3d") return ReadC3dMarkers(path, unit);
  if (extension == ".trc") return ReadTrcMarkers(path, unit);
  if (extension == ".bvh") return internal::ReadBvhMarkers(path, unit);
  if (extension == ".csv") return internal::ReadCsvMarkers(path, unit);
  if (extension == ".tsv") return internal::ReadTsvMarkers(path, unit);
  if (extension == ".sto") return internal::ReadStoMarkers(path, unit);
  if (extension == ".npz") return internal::ReadNpzMarkers(path, unit);
  if (extension == ".npy") return internal::ReadNpyMarkers(path, unit);
  if (extension == ".h5") return internal::ReadDeepLabCutMarkers(path, unit);
  if (extension == ".parquet")
    throw FormatError(path, "",
                      "Parquet is not read; give FreeMoCap's *_by_trajectory.csv of the same recording, or its folder");
  if (extension == ".mot")
    throw FormatError(path, "", "holds joint angles or forces, no positions; give the .trc of the same trial");
  throw FormatError(
      path, "",
      "is no file of 3D points: a folder of triangulate, FreeMoCap, DeepLabCut or EasyMocap, .trc, .c3d, .bvh, .csv, .tsv, "
      ".sto, .npz, .npy or .h5");
}

}  // namespace

std::optional<double> MetresPerUnit(std::string_view word) {
  std::string lower = Lower(word);
  double times = 1;
  const size_t digits = lower.find_first_not_of("0123456789.");
  if (digits != 0 && digits != std::string::npos) {
    const NumberCell number = ReadNumberCell(lower.substr(0, digits));
    if (!(number.value > 0)) return std::nullopt;
    times = number.value, lower.erase(0, digits);
  }
  for (const auto& [metres, words] : {std::pair<double, std::string_view>(1, "|m|meter|meters|metre|metres|"),
                                      {0.01, "|cm|centimeter|centimeters|centimetre|centimetres|"},
                                      {0.001, "|mm|millimeter|millimeters|millimetre|millimetres|"},
                                      {0.0254, "|in|inch|inches|"}}) {
    if (!lower.empty() && words.find("|" + lower + "|") != std::string_view::npos) return times * metres;
  }
  return std::nullopt;
}

bool IsPointsFile(const std::string& path) {
  const std::string extension = ExtensionOf(path);
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return internal::FindEasyMocapPoints(path) == path;
  return std::find(kPointFiles.begin(), kPointFiles.end(), extension) != kPointFiles.end() &&
         std::filesystem::is_regular_file(path, error);
}

Eigen::Vector3d WorldFromAxes(const Eigen::Vector3d& x, const std::string& up) {
  if (up == "z") return x;
  if (up == "y") return {x.z(), x.x(), x.y()};
  if (up == "x") return {x.y(), x.z(), x.x()};
  throw UsageError("option 'up' " + up + ": must be x, y or z");
}

Eigen::Vector3d AxesFromWorld(const Eigen::Vector3d& x, const std::string& up) {
  if (up == "y") return WorldFromAxes(x, "x");
  return up == "x" ? WorldFromAxes(x, "y") : WorldFromAxes(x, up);
}

MarkerFile ReadMarkers(const std::string& path, const std::string& unit, const std::string& up) {
  if (!unit.empty() && !MetresPerUnit(unit))
    throw UsageError("unit '" + unit + "' of " + path + ": expected m, cm, mm, in, or the length of one unit, e.g. 25mm");
  if (!up.empty()) WorldFromAxes(Eigen::Vector3d::Zero(), up);
  MarkerFile file = ReadByExtension(path, unit);
  const bool bvh = ExtensionOf(path) == ".bvh";
  if (!bvh) LeaveOutZeros(&file);
  if (up.empty()) return file;
  for (JointRow& row : file.pose.rows) {
    const Eigen::Vector3d x = row.x_in_world;
    const Eigen::Vector3d in_file = bvh ? Eigen::Vector3d(x.x(), x.z(), -x.y()) : AxesFromWorld(x, file.y_up ? "y" : "z");
    if (!bvh || up != "y") row.x_in_world = WorldFromAxes(in_file, up);
  }
  if (bvh && up != "y" && file.pose.definition) file.pose.definition->rest_m.clear();  // a rest has y up
  file.up = up, file.y_up = up == "y";
  const auto about_up = [](const std::string& note) { return note.find("option 'up'") != std::string::npos; };
  file.notes.erase(std::remove_if(file.notes.begin(), file.notes.end(), about_up), file.notes.end());
  return file;
}

std::string UnitConflict(const MarkerFile& file, const std::string& path) {
  constexpr double kLeastM = 0.005, kMostM = 20;
  const double spread_m = SpreadOf(file.pose);
  if (spread_m == 0 || (spread_m >= kLeastM && spread_m <= kMostM)) return "";
  return Format("%s: read in %s, the points of one time step lie %s %.3g m; its lengths may have another unit", path.c_str(),
                file.unit.c_str(), spread_m < kLeastM ? "within" : "over", spread_m);
}

std::vector<std::string> NotesOf(const MarkerFile& file, const std::string& path) {
  std::vector<std::string> notes;
  for (const std::string& note : file.notes) notes.push_back(path + ": " + note);
  return notes;
}

std::string PointsFileAt(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (!fs::is_directory(path, error)) return path;
  for (const fs::path& folder : {fs::path(path), fs::path(path) / "pose3d"}) {
    if (fs::exists(folder / "points.csv", error)) return (folder / "points.csv").string();
  }
  if (fs::exists(fs::path(path) / "pose3d.json", error)) return "";
  const std::string easymocap = internal::FindEasyMocapPoints(path);
  return easymocap.empty() ? internal::FindProgramPoints(path) : easymocap;
}

Pose3d ReadPoints3d(const std::string& path, const std::string& unit, const std::string& up, MarkerFile* file) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (!fs::exists(path, error))
    throw IoError(path, "does not exist; give a folder of triangulate, its points.csv, or a file of markers");
  const std::string found = PointsFileAt(path);
  const std::string name = Lower(fs::path(found).filename().string());
  if (found.empty() || name == "pose3d.json" || name == "points.csv") {
    const fs::path folder = found.empty() ? fs::path(path) : fs::path(found).parent_path();
    if (found.empty() || fs::is_regular_file(folder / "pose3d.json", error))
      return ReadPose3d(folder.empty() ? "." : folder.string());
    return Pose3d{"points", ReadPointsCsv(found)};
  }
  MarkerFile read = ReadMarkers(found, unit, up);
  if (found != path) read.notes.insert(read.notes.begin(), "its 3D joints are those of " + found);
  Pose3d pose = read.pose;
  if (file) *file = std::move(read);
  return pose;
}

}  // namespace mvstudio::dataset
