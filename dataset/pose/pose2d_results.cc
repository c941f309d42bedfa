#include <cmath>
#include <set>

#include "core/disk/files.h"
#include "dataset/pose/pose2d_parse.h"
#include "dataset/pose/score_scale.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset {
namespace {

using internal::PoseFile;
using nlohmann::json;

/// The frames of a list's images by their texts, `image_id` or the names of COCO's `images`.
using Frames = std::map<std::string, std::optional<int>>;

int ReadFrame(const json& entry, const char* key, const PoseFile& file, const Frames& frames) {
  auto value = entry.find(key);
  for (const char* other : {"frame", "frame_id", "frame_idx", "frame_index", "frame_number"}) {
    if (value == entry.end()) value = entry.find(other);
  }
  if (value == entry.end()) file.Fail(key, "is not there");
  const auto known = frames.find(value->is_string() ? value->get<std::string>() : value->dump());
  const auto number = known == frames.end() ? std::nullopt : known->second;
  if (number) return *number;
  const bool in_range = value->is_number_integer() && *value >= 0 && *value <= 999999999;
  if (!in_range) file.Fail(key, "holds no frame number (0 to 999999999, or a file name with one)");
  return value->get<int>();
}

/// The frames of images' names; two images are two frames.
Frames FramesOfDistinct(const std::set<std::string>& images, const PoseFile& whole) {
  Frames frames = internal::FramesOfNames({images.begin(), images.end()});
  std::map<int, std::string> names;
  for (const auto& [name, frame] : frames) {
    if (!frame) continue;
    const auto [at, is_new] = names.emplace(*frame, name);
    if (!is_new)
      whole.Fail("image_id", "`" + at->second.substr(0, 80) + "` and `" + name.substr(0, 80) + "` are both frame " +
                                 std::to_string(*frame) + ": give the images of one camera, numbered by their names");
  }
  return frames;
}

Frames FramesOfImages(const json& list, const PoseFile& whole) {
  std::set<std::string> distinct;
  for (const json& entry : list) {
    const auto id = entry.is_object() ? entry.find("image_id") : entry.end();
    if (entry.is_object() && id != entry.end() && id->is_string()) distinct.insert(id->get<std::string>());
  }
  return FramesOfDistinct(distinct, whole);
}

/// COCO's annotations name images by ids, and these stand beside the files' names.
Frames FramesOfAnnotated(const json& images, const PoseFile& whole) {
  std::map<std::string, std::string> names;
  std::set<std::string> distinct;
  for (size_t i = 0; i < images.size(); ++i) {
    const std::string where = "images[" + std::to_string(i) + "]";
    const bool good = images[i].is_object() && images[i].contains("id") && images[i].contains("file_name") &&
                      images[i]["file_name"].is_string();
    if (!good) whole.Fail(where, "has no id or no file_name");
    const json& id = images[i]["id"];
    std::string& name = names[id.is_string() ? id.get<std::string>() : id.dump()];
    name = images[i]["file_name"].get<std::string>();
    distinct.insert(name);
  }
  const Frames of_names = FramesOfDistinct(distinct, whole);
  Frames frames;
  for (const auto& [id, name] : names) frames[id] = of_names.at(name);
  return frames;
}

/// One entry of a COCO results list.
void ReadCocoEntry(const json& entry, const PoseFile& file, const Frames& frames, Pose2dTrack* track) {
  std::vector<Person2d> people;
  internal::AppendPerson(entry, "", file, &people);
  track->frames[ReadFrame(entry, "image_id", file, frames)].push_back(std::move(people[0]));
}

json UnscoredJson(const json& x, const json& y) {
  return x.is_number() && y.is_number() ? ScoreOfUnscored(x.get<double>(), y.get<double>()) : 1;
}

/// Keypoints that bear names, {"name": "nose", "x": …, "y": …, "score": …} or TensorFlow's {"part", "position": {"x", "y"}}, as
/// one flat list in the skeleton's order; those that are not there are not detected.
json FlattenNamed(const json& keypoints, const std::string& list, const PoseFile& file) {
  json flat = json::array();
  for (size_t j = 0; j < file.skeleton.joints.size(); ++j) flat.insert(flat.end(), {0, 0, 0});
  for (size_t k = 0; k < keypoints.size(); ++k) {
    const json& point = keypoints[k];
    const std::string where = list + "[" + std::to_string(k) + "]", name = internal::NameOfPoint(point);
    if (name.empty()) file.Fail(where, "has no name, as other keypoints have");
    const int joint = geometry::FindJoint(file.skeleton, name);
    if (joint < 0) file.Fail(where, geometry::UnknownJoint(file.skeleton, name));
    const json& place = point.contains("position") && point["position"].is_object() ? point["position"] : point;
    if (!place.contains("x") || !place.contains("y")) file.Fail(where, "has no x and y");
    const size_t at = 3 * static_cast<size_t>(joint);
    flat[at] = place["x"], flat[at + 1] = place["y"];
    flat[at + 2] = UnscoredJson(place["x"], place["y"]);
    for (const char* score : {"score", "confidence", "visibility", "likelihood"}) {
      if (point.contains(score)) flat[at + 2] = point[score];
    }
  }
  return flat;
}

/// Keypoints of three numbers each as one flat list: [[x, y, s], …] of EasyMocap and older MMPose, and of Ultralytics
/// {"x": […], "y": […], "visible": […]}.
json FlattenTriples(const json& keypoints, const std::string& list, const PoseFile& file) {
  json flat = json::array();
  if (keypoints.is_object()) {
    const json none = json::array();
    const json x = keypoints.value("x", none), y = keypoints.value("y", none), s = keypoints.value("visible", none);
    const bool good =
        x.is_array() && y.is_array() && s.is_array() && x.size() == y.size() && (s.empty() || s.size() == x.size());
    if (!good) file.Fail(list, "`x`, `y` and `visible` are not arrays of one length");
    for (size_t k = 0; k < x.size(); ++k) flat.insert(flat.end(), {x[k], y[k], s.empty() ? UnscoredJson(x[k], y[k]) : s[k]});
    return flat;
  }
  for (size_t k = 0; k < keypoints.size(); ++k) {
    const json& point = keypoints[k];
    if (!point.is_array() || (point.size() != 3 && point.size() != 2))
      file.Fail(list + "[" + std::to_string(k) + "]", "is not x, y and a score");
    flat.insert(flat.end(), {point[0], point[1], point.size() == 3 ? point[2] : UnscoredJson(point[0], point[1])});
  }
  return flat;
}

/// MMPose's `keypoints` [[x, y], …] and `keypoint_scores` [s, …] as one flat list.
json Flatten(const json& instance, const std::string& where, const PoseFile& file) {
  const json points = instance.value("keypoints", json::array()), scores = instance.value("keypoint_scores", json::array());
  if (!points.is_array() || !scores.is_array() || points.size() != scores.size()) {
    file.Fail(where, "`keypoints` and `keypoint_scores` are not two arrays of one length");
  }
  json flat = json::array();
  for (size_t k = 0; k < points.size(); ++k) {
    if (points[k].is_null()) {
      flat.insert(flat.end(), {nullptr, nullptr, nullptr});
      continue;
    }
    if (!points[k].is_array() || points[k].size() != 2) {
      file.Fail(where + ".keypoints[" + std::to_string(k) + "]", "is not a pair of numbers");
    }
    flat.push_back(points[k][0]), flat.push_back(points[k][1]), flat.push_back(scores[k]);
  }
  return flat;
}

void ReadMmposeEntry(const json& entry, const PoseFile& file, Pose2dTrack* track) {
  if (!entry.is_object()) file.Fail("", "is not an object");
  auto instances = entry.find("instances");
  if (instances == entry.end()) instances = entry.find("predictions");
  if (instances == entry.end() || !instances->is_array()) file.Fail("instances", "is not there or not an array");
  std::vector<Person2d> people;
  for (size_t i = 0; i < instances->size(); ++i) {
    const std::string where = "instances[" + std::to_string(i) + "]";
    internal::AppendPerson((*instances)[i], where, file, &people);
  }
  if (!track->frames.emplace(ReadFrame(entry, "frame_id", file, {}), std::move(people)).second) {
    file.Fail("frame_id", "this frame number came before");
  }
}

/// The list of a whole video's results, and what its entries are.
struct Results {
  const json* list = nullptr;
  bool mmpose = false;
  std::string place;
  Frames frames;
};

/// AlphaPose's formats "open" and "cmu" by images' names, {"0.jpg": {"people": […]}} and {"0.jpg": {"bodies": […]}}, as a list
/// of COCO's kind; null: it is none of them.
json CocoOfImages(const json& root, const PoseFile& whole) {
  if (!root.is_object() || root.empty()) return nullptr;
  json list = json::array();
  for (const auto& [name, image] : root.items()) {
    if (!image.is_object()) return nullptr;
    const bool bodies = image.contains("bodies");
    const auto people = image.find(bodies ? "bodies" : "people");
    if (people == image.end() || !people->is_array()) return nullptr;
    for (const json& person : *people) {
      const char* const key = bodies ? "joints" : "pose_keypoints_2d";
      if (!person.is_object() || !person.contains(key))
        whole.Fail(name.substr(0, 80), std::string("a person has no list ") + key);
      list.push_back({{"image_id", name}, {"keypoints", person[key]}});
    }
  }
  return list;
}

/// Where each joint of the skeleton stands in a file of easy_ViTPose, by the names in its `skeleton` {"0": "nose", …}.
std::vector<std::string> PlacesInViTPose(const json& names, const PoseFile& whole) {
  std::map<std::string, std::string> places;
  for (const auto& [place, name] : names.items()) {
    if (name.is_string()) places[geometry::JointKey(name.get<std::string>())] = place;
  }
  std::vector<std::string> found;
  for (const std::string& joint : whole.skeleton.joints) {
    const auto at = places.find(geometry::JointKey(joint));
    if (at == places.end())
      whole.Fail("skeleton", "names no joint `" + joint + "` of skeleton " + whole.skeleton.name +
                                 ": give the skeleton whose joints the model finds (coco17 for coco and coco_25)");
    found.push_back(at->second);
  }
  return found;
}

/// A file of easy_ViTPose, {"keypoints": [{"0": [[y, x, score], …]}, …], "skeleton": {…}} with a person by an id, as a list of
/// COCO's kind, x first and in the skeleton's order; null: it is none.
json CocoOfViTPose(const json& root, const PoseFile& whole) {
  const bool good = root.is_object() && root.contains("keypoints") && root["keypoints"].is_array() &&
                    root.contains("skeleton") && root["skeleton"].is_object();
  if (!good) return nullptr;
  const std::vector<std::string> places = PlacesInViTPose(root["skeleton"], whole);
  json list = json::array();
  for (size_t frame = 0; frame < root["keypoints"].size(); ++frame) {
    const json& people = root["keypoints"][frame];
    const std::string where = "keypoints[" + std::to_string(frame) + "]";
    if (!people.is_object()) whole.Fail(where, "is no object of people");
    for (const auto& [id, points] : people.items()) {
      json flat = json::array();
      for (const std::string& place : places) {
        const size_t k = place.size() < 5 && !place.empty() && place.find_first_not_of("0123456789") == std::string::npos
                             ? std::stoul(place)
                             : points.size();
        if (!points.is_array() || k >= points.size() || !points[k].is_array() || points[k].size() != 3)
          whole.Fail(where + "." + id.substr(0, 20) + "[" + place.substr(0, 20) + "]", "is not y, x and a score");
        flat.insert(flat.end(), {points[k][1], points[k][0], points[k][2]});
      }
      list.push_back({{"image_id", frame}, {"keypoints", std::move(flat)}});
    }
  }
  return list;
}

/// What an export for labels is, which holds marks without COCO's lists; empty: none that is known.
std::string LabelProgram(const json& root) {
  const json& first = root.is_array() && !root.empty() ? root[0] : root;
  if (!first.is_object()) return "";
  if (root.contains("_via_img_metadata") || root.contains("_via_settings")) return "a project of VIA";
  if (first.contains("annotations") && first.contains("data")) return "an export of Label Studio";
  if (first.contains("shapes") && first.contains("imagePath")) return "a file of LabelMe";
  if (first.contains("landmarks") || first.contains("pose_landmarks")) return "landmarks of MediaPipe";
  return "";
}

Results FindResults(const json& root, const PoseFile& whole) {
  Results results;
  const std::string program = LabelProgram(root);
  if (!program.empty())
    whole.Fail("", program +
                       ", which is not read; write COCO keypoints (`image_id`, `keypoints` with x, y in px and a score), "
                       "or a table of this camera with columns frame, nose_x, nose_y, nose_score, …");
  if (root.is_array()) results.list = &root;
  for (const char* key : {"instance_info", "annotations"}) {
    if (root.is_object() && root.contains(key)) results.list = &root[key], results.place = key;
  }
  if (!results.list || !results.list->is_array()) {
    whole.Fail("",
               "neither a list of detections (COCO, MMPose) nor an object with `instance_info` (MMPose) or `annotations` "
               "(COCO); give a folder of OpenPose files, one a frame, or one such file");
  }
  const json& list = *results.list;
  const auto first_has = [&](const char* key) { return !list.empty() && list[0].is_object() && list[0].contains(key); };
  results.mmpose = results.place == "instance_info" || first_has("instances") || first_has("predictions");
  const bool named = results.place == "annotations" && root.contains("images") && root["images"].is_array();
  if (!results.mmpose) results.frames = named ? FramesOfAnnotated(root["images"], whole) : FramesOfImages(list, whole);
  return results;
}

/// OpenPifPaf's results of a video, an object in each line, as one list; other texts as they are.
std::string ListOfLines(std::string text) {
  const size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  const size_t end = first == std::string::npos ? first : text.find('\n', first);
  const size_t second = end == std::string::npos ? end : text.find_first_not_of(" \t\r\n", end);
  const size_t last = end == std::string::npos ? end : text.find_last_not_of(" \t\r", end - 1);
  if (second == std::string::npos || text[first] != '{' || text[second] != '{' || text[last] != '}') return text;
  std::string list = "[";
  for (size_t at = first; at < text.size();) {
    const size_t stop = std::min(text.find('\n', at), text.size());
    const bool blank = text.find_first_not_of(" \t\r", at) >= stop;
    if (!blank) list += (list.size() > 1 ? "," : "") + text.substr(at, stop - at);
    at = stop + 1;
  }
  return list + "]";
}

/// All entries of a file, in the order of `whole.skeleton`.
Pose2dTrack ReadAllEntries(const json& read, const PoseFile& whole, const std::string& camera) {
  Pose2dTrack track{camera, {}};
  json as_coco = CocoOfViTPose(read, whole);
  if (as_coco.is_null()) as_coco = CocoOfImages(read, whole);
  const json& root = as_coco.is_null() ? read : as_coco;
  const Results results = FindResults(root, whole);
  track.every_frame = results.mmpose;
  internal::Tolerant tolerant(&track.skipped);
  for (size_t i = 0; i < results.list->size(); ++i) {
    const PoseFile file{whole.path, whole.place + ", " + results.place + "[" + std::to_string(i) + "]", whole.skeleton};
    const json& entry = (*results.list)[i];
    tolerant.Try(
        [&] { results.mmpose ? ReadMmposeEntry(entry, file, &track) : ReadCocoEntry(entry, file, results.frames, &track); });
  }
  tolerant.Finish();
  return track;
}

}  // namespace

void internal::AppendPerson(const json& entry, const std::string& where, const PoseFile& file, std::vector<Person2d>* people) {
  if (!entry.is_object()) file.Fail(where, "is not an object");
  const auto keypoints = entry.find("keypoints");
  const std::string list = where + (where.empty() ? "" : ".") + "keypoints";
  const bool scored = entry.contains("keypoint_scores");
  const bool listed = keypoints != entry.end() && (keypoints->is_array() || (keypoints->is_object() && !scored));
  if (!listed) file.Fail(list, "is not there or not an array");
  const bool triples = !scored && (keypoints->is_object() || (!keypoints->empty() && (*keypoints)[0].is_array()));
  const bool named = !scored && keypoints->is_array() && !keypoints->empty() && (*keypoints)[0].is_object();
  Person2d person;
  internal::AppendKeypoints(scored    ? Flatten(entry, where, file)
                            : named   ? FlattenNamed(*keypoints, list, file)
                            : triples ? FlattenTriples(*keypoints, list, file)
                                      : *keypoints,
                            file.skeleton.joints.size(), scored ? where : list, file, &person);
  people->push_back(std::move(person));
}

Pose2dTrack ReadPoseResults(const std::string& path, const std::string& camera, const geometry::Skeleton& skeleton) {
  const PoseFile whole{path, "camera " + camera, skeleton};
  const json read = internal::ParsePoseJson(ListOfLines(ReadFile(path)), whole);
  const std::optional<geometry::Skeleton> stated = internal::StatedSkeleton(read);
  if (!stated) return ReadAllEntries(read, whole, camera);
  Pose2dTrack track = ReadAllEntries(read, {path, whole.place, *stated}, camera);
  for (auto& [frame, people] : track.frames)
    internal::ToAskedJoints(*stated, internal::MayLeaveOutJoints(read), whole, &people);
  return track;
}

}  // namespace mvstudio::dataset
