#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/json/json_file.h"
#include "dataset/pose/marker_formats.h"
#include "dataset/pose/marker_programs.h"
#include "dataset/pose/pose2d_parse.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::dataset::internal {
namespace {

namespace fs = std::filesystem;

constexpr size_t kWithFace = 137, kWithHands = 67;  // the face stands behind the hands

/// EasyMocap's points have no names: `body25`, `bodyhand`, `bodyhandface`, COCO's.
geometry::Skeleton SkeletonOfCount(size_t count, const std::string& path, const std::string& where) {
  const std::map<size_t, const char*> known = {
      {17, "coco17"}, {25, "body25"}, {kWithHands, "body25+hands"}, {kWithFace, "body25+hands"}};
  const auto found = known.find(count);
  if (found == known.end())
    throw FormatError(
        path, where,
        std::to_string(count) + " points; EasyMocap's are 17 (COCO), 25 (BODY_25), 67 (with hands) or 137 (with face)");
  return geometry::SkeletonByName(found->second);
}

Eigen::Vector3d PointOf(const Json& point, const std::string& path, const std::string& where) {
  const bool good = point.is_array() && (point.size() == 3 || point.size() == 4) &&
                    std::all_of(point.begin(), point.end(), [](const Json& v) { return v.is_number() || v.is_null(); });
  if (!good) throw FormatError(path, where, "is not x, y, z and a confidence");
  const bool seen = std::none_of(point.begin(), point.end(), [](const Json& v) { return v.is_null(); }) &&
                    (point.size() == 3 || point[3].get<double>() > 0);
  if (!seen) return Eigen::Vector3d::Constant(std::nan(""));
  return {point[0].get<double>(), point[1].get<double>(), point[2].get<double>()};
}

/// Adds the people of a frame; `count`: how many points a person has, 0 before the first.
void AddFrame(const std::string& path, int frame, double metres, size_t* count, Pose3d* pose) {
  const Json root = ParseJson(ReadFile(path), path, true);
  if (!root.is_array()) throw FormatError(path, "", "a list of people, {id, keypoints3d}, was expected");
  for (size_t i = 0; i < root.size(); ++i) {
    const std::string where = "[" + std::to_string(i) + "]";
    const bool good = root[i].is_object() && root[i].contains("keypoints3d") && root[i]["keypoints3d"].is_array() &&
                      root[i].contains("id") && root[i]["id"].is_number_integer();
    if (!good) throw FormatError(path, where, "has no whole number `id` or no list `keypoints3d`");
    const Json& points = root[i]["keypoints3d"];
    const geometry::Skeleton skeleton = SkeletonOfCount(points.size(), path, where + ".keypoints3d");
    if (*count != 0 && *count != points.size())
      throw FormatError(path, where + ".keypoints3d",
                        std::to_string(points.size()) + " points, others have " + std::to_string(*count));
    *count = points.size(), pose->skeleton = skeleton.name;
    for (size_t j = 0; j < skeleton.joints.size(); ++j) {
      const Eigen::Vector3d x = PointOf(points[j], path, where + ".keypoints3d[" + std::to_string(j) + "]");
      AddMarkerRow(frame, root[i]["id"].get<int>(), skeleton.joints[j], x * metres, pose);
    }
  }
}

/// Its JSON files by frame.
std::map<int, std::string> FramesOfFolder(const std::string& folder) {
  std::map<int, std::string> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".json" || name[0] == '.') continue;
    const std::optional<int> frame = FrameNumber(name);
    if (!frame) throw FormatError(entry.path().string(), "", "the file name holds no frame number");
    if (!files.emplace(*frame, entry.path().string()).second)
      throw FormatError(entry.path().string(), "", "another file of this folder has the same frame number");
  }
  return files;
}

}  // namespace

std::string FindEasyMocapPoints(const std::string& folder) {
  const fs::path inside = fs::path(folder) / "keypoints3d";
  std::error_code error;
  if (fs::is_directory(inside, error)) return inside.string();
  const fs::path name =
      fs::path(folder).filename().empty() ? fs::path(folder).parent_path().filename() : fs::path(folder).filename();
  return name == "keypoints3d" && fs::is_directory(folder, error) ? folder : "";
}

MarkerFile ReadEasyMocapMarkers(const std::string& folder, const std::string& unit) {
  MarkerFile file;
  file.unit = UnitOrAsk(unit, "", folder), file.y_up = false;
  size_t count = 0;
  for (const auto& [frame, path] : FramesOfFolder(folder)) AddFrame(path, frame, *MetresPerUnit(file.unit), &count, &file.pose);
  if (file.pose.rows.empty()) throw FormatError(folder, "", "holds no person: no .json file has {id, keypoints3d}");
  SortByFrame(folder, &file.pose);
  file.notes.push_back("its axes are kept, z as up: EasyMocap states no axis (mvstudio markers: option 'up')");
  if (count == kWithFace) file.notes.push_back("the 70 points of the face are left out");
  return file;
}

}  // namespace mvstudio::dataset::internal
