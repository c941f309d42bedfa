#include "dataset/pose/markers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <vector>

#include "core/error.h"
#include "core/format.h"
#include "core/statistics.h"
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

}  // namespace

std::optional<double> MetresPerUnit(std::string_view word) {
  const std::string lower = Lower(word);
  for (const auto& [metres, words] : {std::pair<double, std::string_view>(1, "|m|meter|meters|metre|metres|"),
                                      {0.01, "|cm|centimeter|centimeters|centimetre|centimetres|"},
                                      {0.001, "|mm|millimeter|millimeters|millimetre|millimetres|"},
                                      {0.0254, "|in|inch|inches|"}}) {
    if (!lower.empty() && words.find("|" + lower + "|") != std::string_view::npos) return metres;
  }
  return std::nullopt;
}

bool IsMarkerFile(const std::string& path) {
  std::error_code error;
  const std::string extension = ExtensionOf(path);
  return (extension == ".trc" || extension == ".c3d") && std::filesystem::is_regular_file(path, error);
}

MarkerFile ReadMarkers(const std::string& path, const std::string& unit) {
  if (!unit.empty() && !MetresPerUnit(unit)) throw UsageError("unit '" + unit + "' of " + path + ": expected m, cm, mm or in");
  return ExtensionOf(path) == ".c3d" ? ReadC3dMarkers(path, unit) : ReadTrcMarkers(path, unit);
}

std::string UnitDoubt(const MarkerFile& file, const std::string& path) {
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

Pose3d ReadPoints3d(const std::string& path, const std::string& unit) {
  return IsMarkerFile(path) ? ReadMarkers(path, unit).pose : ReadPose3d(path);
}

}  // namespace mvstudio::dataset
