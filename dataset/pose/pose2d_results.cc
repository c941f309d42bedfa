#include <cmath>

#include "core/disk/files.h"
#include "dataset/pose/pose2d_parse.h"

namespace mvstudio::dataset {
namespace {

using internal::PoseFile;
using nlohmann::json;

int ReadFrame(const json& entry, const char* key, const PoseFile& file) {
  const auto value = entry.find(key);
  if (value == entry.end()) file.Fail(key, "is not there");
  const bool in_range = value->is_number_integer() && *value >= 0 && *value <= 999999999;
  if (in_range) return value->get<int>();
  const auto number = value->is_string() ? internal::FrameNumber(value->get<std::string>()) : std::nullopt;
  if (!number) file.Fail(key, "holds no frame number (0 to 999999999, or a file name with one)");
  return *number;
}

/// One entry of a COCO results list.
void ReadCocoEntry(const json& entry, const PoseFile& file, Pose2dTrack* track) {
  if (!entry.is_object()) file.Fail("", "is not an object");
  const auto keypoints = entry.find("keypoints");
  if (keypoints == entry.end() || !keypoints->is_array()) file.Fail("keypoints", "is not there or not an array");
  Person2d person;
  internal::AppendKeypoints(*keypoints, file.skeleton.joints.size(), "keypoints", file, &person);
  track->frames[ReadFrame(entry, "image_id", file)].push_back(std::move(person));
}

/// MMPose's `keypoints` [[x, y], …] and `keypoint_scores` [s, …] as one flat list.
json Flatten(const json& instance, const std::string& where, const PoseFile& file) {
  if (!instance.is_object()) file.Fail(where, "is not an object");
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
  const auto instances = entry.find("instances");
  if (instances == entry.end() || !instances->is_array()) file.Fail("instances", "is not there or not an array");
  std::vector<Person2d> people;
  for (size_t i = 0; i < instances->size(); ++i) {
    const std::string where = "instances[" + std::to_string(i) + "]";
    internal::AppendKeypoints(Flatten((*instances)[i], where, file), file.skeleton.joints.size(), where, file,
                              &people.emplace_back());
  }
  if (!track->frames.emplace(ReadFrame(entry, "frame_id", file), std::move(people)).second) {
    file.Fail("frame_id", "this frame number came before");
  }
}

}  // namespace

Pose2dTrack ReadPoseResults(const std::string& path, const std::string& camera, const geometry::Skeleton& skeleton) {
  Pose2dTrack track{camera, {}};
  const PoseFile whole{path, "camera " + camera, skeleton};
  const json root = internal::ParsePoseJson(ReadFile(path), whole);
  const bool mmpose = root.is_object() && root.contains("instance_info");
  const json& list = mmpose ? root["instance_info"] : root;
  if (!list.is_array()) {
    whole.Fail("",
               "neither a list of detections (COCO results) nor an object with `instance_info` (MMPose); give a folder of "
               "OpenPose files, one a frame, or one such file");
  }
  internal::Tolerant tolerant(&track.skipped);
  for (size_t i = 0; i < list.size(); ++i) {
    const std::string place = std::string(mmpose ? "instance_info" : "") + "[" + std::to_string(i) + "]";
    const PoseFile file{path, whole.place + ", " + place, skeleton};
    tolerant.Try([&] { mmpose ? ReadMmposeEntry(list[i], file, &track) : ReadCocoEntry(list[i], file, &track); });
  }
  tolerant.Finish();
  return track;
}

}  // namespace mvstudio::dataset
