#include <algorithm>
#include <limits>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/join.h"
#include "core/label.h"
#include "core/text/words.h"
#include "dataset/arrays/npz.h"
#include "dataset/pose/score_scale.h"
#include "dataset/trackers/tracker_readers.h"
#include "dataset/trackers/tracker_table.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::dataset {
namespace {

constexpr char kOneCamera[] = "frames x joints x 2 (x, y) or 3 (with a score), or frames x people x joints x 2 or 3";
constexpr int64_t kMostPeople = 20;  // of the axis of people; more are frames, unless there are more frames than those

struct PointArrays {
  NpyArray points, scores;  ///< scores: without the last axis; empty: none
  std::vector<std::string> joints, cameras;
};

std::string AxesText(const NpyArray& array) {
  return Join(array.shape, " x ", [](int64_t size) { return std::to_string(size); });
}

bool HoldsPixels(const NpyArray& array) {
  return array.shape.size() >= 3 && array.shape.size() <= 5 && (array.shape.back() == 2 || array.shape.back() == 3);
}

bool IsNameOfScores(const std::string& name) {
  static const std::set<std::string> kNames = {"scores",     "score",          "confidence", "conf",
                                               "likelihood", "keypointscores", "visibility"};
  return kNames.count(PlainWord(name)) > 0;
}

std::vector<std::string> NamesIn(const std::map<std::string, std::string>& members, std::initializer_list<const char*> keys,
                                 const std::string& path) {
  for (const char* key : keys) {
    const auto found = members.find(key);
    if (found == members.end()) continue;
    std::vector<std::string> names = ParseNpyTexts(found->second, path + ": " + key);
    for (const std::string& name : names) {
      if (const std::string why = WhyNotALabel(name); !why.empty()) throw FormatError(path, key, "a name there " + why);
    }
    return names;
  }
  return {};
}

PointArrays ReadArchive(const std::string& path) {
  const std::map<std::string, std::string> members = ReadNpzMembers(path);
  PointArrays arrays;
  arrays.joints = NamesIn(members, {"joint_names", "keypoint_names", "names"}, path);
  arrays.cameras = NamesIn(members, {"cameras", "camera_names"}, path);
  std::vector<std::string> found, all;
  std::map<std::string, NpyArray> scores;
  for (const auto& [name, bytes] : members) {
    std::optional<NpyArray> array;
    try {
      array = ParseNpy(bytes, path + ": " + name);
    } catch (const FormatError&) {  // texts and other types
      continue;
    }
    all.push_back(name + " " + AxesText(*array));
    if (IsNameOfScores(name)) {
      scores[name] = std::move(*array);
    } else if (HoldsPixels(*array)) {
      found.push_back(name), arrays.points = std::move(*array);
    }
  }
  if (found.size() != 1)
    throw FormatError(path, "",
                      found.empty()
                          ? "holds no array of 2D joints, " + std::string(kOneCamera) + "; its arrays: " + Join(all, ", ")
                          : "holds several arrays of 2D joints: " + Join(found, ", ") + "; leave one in it");
  std::vector<int64_t> shape(arrays.points.shape.begin(), arrays.points.shape.end() - 1);
  std::string name_of_scores;
  for (auto& [name, array] : scores) {
    if (array.shape.size() == shape.size() + 1 && array.shape.back() == 1) array.shape.pop_back();
    if (array.shape != shape || arrays.points.shape.back() != 2) continue;
    if (!name_of_scores.empty())
      throw FormatError(path, "", "holds two arrays of scores: " + name_of_scores + ", " + name + "; leave one in it");
    name_of_scores = name, arrays.scores = std::move(array);
  }
  return arrays;
}

PointArrays ReadPoints(const std::string& path) {
  PointArrays arrays;
  if (PlainWord(path.substr(path.find_last_of('.') + 1)) == "npz") {
    arrays = ReadArchive(path);
  } else {
    arrays.points = ReadNpy(path);
  }
  if (!HoldsPixels(arrays.points))
    throw FormatError(path, "", "is an array of " + AxesText(arrays.points) + "; 2D joints of a camera are " + kOneCamera);
  const auto [least, most] = std::minmax_element(arrays.points.shape.begin(), arrays.points.shape.end());
  if (*least < 1 || *most > std::numeric_limits<int>::max())
    throw FormatError(path, "",
                      "is an array of " + AxesText(arrays.points) + (*least < 1 ? ": it holds no joints" : ": it is too long"));
  const size_t count = static_cast<size_t>(arrays.points.shape[arrays.points.shape.size() - 2]);
  if (!arrays.joints.empty() && arrays.joints.size() != count)
    throw FormatError(path, "joint_names",
                      "has " + std::to_string(arrays.joints.size()) + " names for " + std::to_string(count) + " joints");
  if (arrays.joints.empty() && count == 33) arrays.joints = geometry::SkeletonByName("mediapipe33").joints;
  for (size_t j = arrays.joints.size(); j < count; ++j) arrays.joints.push_back("point_" + std::to_string(j));
  return arrays;
}

/// The part of one camera, from element `begin` of the points on: axes are frames, perhaps people, joints, coordinates.
TrackedPoints CameraOf(const PointArrays& arrays, size_t begin, const std::vector<int64_t>& axes, const std::string& camera) {
  TrackedPoints out;
  out.program = "NumPy", out.joints = arrays.joints;
  const size_t people = axes.size() == 4 ? static_cast<size_t>(axes[1]) : 1, joints = arrays.joints.size();
  const size_t step = static_cast<size_t>(axes.back());
  out.individuals.resize(people);
  for (size_t p = 0; people > 1 && p < people; ++p) out.individuals[p] = std::to_string(p);
  out.track.camera = camera;
  size_t at = begin / step;
  for (int frame = 0; frame < axes[0]; ++frame) {
    std::vector<Person2d>& seen = out.track.frames[frame];
    for (size_t p = 0; p < people; ++p) {
      Person2d person;
      person.keypoints.resize(joints);
      bool any = false;
      for (size_t j = 0; j < joints; ++j, ++at) {
        const double* const xy = arrays.points.values.data() + at * step;
        const double score = step == 3                      ? xy[2]
                             : arrays.scores.values.empty() ? ScoreOfUnscored(xy[0], xy[1])
                                                            : arrays.scores.values[at];
        person.keypoints[j] = internal::ToKeypoint(xy[0], xy[1], score);
        any |= person.keypoints[j].score > 0;
      }
      if (any) seen.push_back(std::move(person));
    }
  }
  return out;
}

}  // namespace

namespace internal {

bool IsPointArray(std::string_view head) { return head.substr(0, 6) == "\x93NUMPY" || head.substr(0, 4) == "PK\x03\x04"; }

TrackedPoints ReadPointArray(const std::string& path, const std::string& camera) {
  const PointArrays arrays = ReadPoints(path);
  const std::vector<int64_t>& axes = arrays.points.shape;
  const bool long_axis = axes.size() == 4 && axes[1] > kMostPeople && axes[1] >= axes[0];
  if (axes.size() == 5 || arrays.cameras.size() > 1 || long_axis)
    throw FormatError(path, "",
                      "is an array of " + AxesText(arrays.points) + ", cameras first; of one camera it is " + kOneCamera +
                          ". Give each camera its part, or all as option 'points2d' FILE.npz with the names in `cameras`");
  return CameraOf(arrays, 0, axes, camera);
}

}  // namespace internal

std::vector<TrackedPoints> ReadPointArrays(const std::string& path) {
  const PointArrays arrays = ReadPoints(path);
  std::vector<int64_t> axes = arrays.points.shape;
  if (axes.size() == 3)
    throw FormatError(
        path, "",
        "is one camera's " + AxesText(arrays.points) + "; give it as option 'pose2d' NAME=FILE, once for each camera");
  const auto num_cameras = static_cast<size_t>(axes[0]);
  if (arrays.cameras.size() != num_cameras)
    throw FormatError(path, "",
                      "is an array of " + AxesText(arrays.points) +
                          ", cameras x frames x joints x coordinates, with the names of " +
                          std::to_string(arrays.cameras.size()) + " cameras instead of " + std::to_string(num_cameras) +
                          ": numpy.savez(FILE, points=…, cameras=[…], joint_names=[…]) gives them, or give each camera's part "
                          "as option 'pose2d' NAME=FILE.npy");
  if (std::set<std::string>(arrays.cameras.begin(), arrays.cameras.end()).size() < num_cameras)
    throw FormatError(path, "cameras", "names a camera twice: " + Join(arrays.cameras, ", "));
  axes.erase(axes.begin());
  const size_t size = arrays.points.values.size() / std::max<size_t>(num_cameras, 1);
  std::vector<TrackedPoints> cameras;
  for (size_t c = 0; c < num_cameras; ++c) cameras.push_back(CameraOf(arrays, c * size, axes, arrays.cameras[c]));
  return cameras;
}

}  // namespace mvstudio::dataset
