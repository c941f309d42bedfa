#include <algorithm>
#include <cctype>
#include <initializer_list>

#include "core/csv.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/text/row_times.h"
#include "dataset/trackers/tracker_readers.h"

/// One camera's points, a row each: frame, joint, x, y and perhaps a score, as people write MediaPipe's landmarks.
namespace mvstudio::dataset::internal {
namespace {

std::vector<std::string> CellsOf(std::string_view line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',') {
      cells.emplace_back();
    } else if (c != '"') {
      cells.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
  }
  return cells;
}

bool HasOneOf(const std::vector<std::string>& cells, std::initializer_list<const char*> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](const char* word) { return std::find(cells.begin(), cells.end(), word) != cells.end(); });
}

/// MediaPipe's landmarks by their numbers become those of its skeleton; other numbers points, as caliscope's.
void NameNumbers(std::vector<std::string>* joints) {
  const auto is_number = [](const std::string& name) {
    return name.size() < 4 && name.find_first_not_of("0123456789") == std::string::npos;
  };
  if (!std::all_of(joints->begin(), joints->end(), is_number)) return;
  const std::vector<std::string>& known = geometry::SkeletonByName("mediapipe33").joints;
  const bool all = joints->size() == known.size() && std::all_of(joints->begin(), joints->end(), [&](const std::string& name) {
                     return static_cast<size_t>(std::stoi(name)) < known.size();
                   });
  for (std::string& name : *joints) name = all ? known[static_cast<size_t>(std::stoi(name))] : "point_" + name;
}

}  // namespace

bool IsLongCsvHeader(std::string_view line) {
  const std::vector<std::string> cells = CellsOf(line);
  const bool placed = (HasOneOf(cells, {"x", "x_px", "u"}) && HasOneOf(cells, {"y", "y_px", "v"}));
  const bool named = HasOneOf(cells, {"joint", "marker", "keypoint", "bodypart", "point", "landmark", "landmark_name",
                                      "landmark_id", "joint_name", "keypoint_name", "joint_id", "keypoint_id"});
  const bool timed = HasOneOf(cells, {"frame", "frame_idx", "frame_number", "frame_id", "frame_index"}) ||
                     std::any_of(cells.begin(), cells.end(), [](const std::string& cell) { return IsTimeColumn(cell); });
  return placed && named && timed && !HasOneOf(cells, {"camera", "cam", "view", "camera_name", "camera_id", "cam_id", "port"});
}

TrackedPoints ReadLongCsv(const std::string& path, const std::string& camera) {
  const std::string text = ReadFile(path);
  const std::vector<std::string> cells = CellsOf(std::string_view(text).substr(0, text.find_first_of("\r\n")));
  if (HasOneOf(cells, {"z"}) && !HasOneOf(cells, {"visibility", "presence"}))
    throw FormatError(path, "line 1",
                      "holds x, y, z: 3D points of several cameras together, which `mvstudio markers convert` reads; here give "
                      "the cameras' own 2D files");
  Pose2dSet set = ReadPose2dCsv(path, nullptr, camera);
  TrackedPoints points;
  points.program = "2D table", points.joints = std::move(set.skeleton.joints), points.individuals = {""};
  points.track = std::move(set.tracks.front()), points.time_step = set.time_step;
  points.track.skipped = std::move(set.skipped);
  NameNumbers(&points.joints);
  return points;
}

}  // namespace mvstudio::dataset::internal
