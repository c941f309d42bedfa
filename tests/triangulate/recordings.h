#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose2d.h"
#include "geometry/rigid/rigid3.h"
#include "tests/support/test_data.h"
#include "triangulate/people/association.h"

/// Recorded 2D poses with their rigs.
namespace mvstudio::triangulate {

struct Recording {
  geometry::Rig rig;
  std::vector<DetectedFrame> frames;
};

inline void AddTrack(const dataset::Pose2dTrack& track, size_t camera_idx, size_t num_cameras,
                     std::map<int, DetectedFrame>* frames) {
  for (const auto& [number, people] : track.frames) {
    DetectedFrame& frame = (*frames)[number];
    frame.frame = number;
    frame.people.resize(num_cameras);
    for (const dataset::Person2d& person : people) {
      DetectedPerson& detected = frame.people[camera_idx].emplace_back();
      for (const auto& key : person.keypoints) detected.push_back({{key.x_px, key.y_px}, key.score});
    }
  }
}

inline std::vector<DetectedFrame> ToList(const std::map<int, DetectedFrame>& frames) {
  std::vector<DetectedFrame> list;
  for (const auto& [number, frame] : frames) list.push_back(frame);
  return list;
}

inline std::vector<double> NumbersIn(std::string text) {
  for (char& c : text) {
    if (c == '[' || c == ']' || c == ',') c = ' ';
  }
  std::istringstream stream(text);
  std::vector<double> numbers;
  for (double value; stream >> value;) numbers.push_back(value);
  return numbers;
}

/// The few keys of the session's Calib_qualisys.toml.
inline geometry::Rig ReadQualisysToml(const std::string& path) {
  geometry::Rig rig;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    const size_t equals = line.find(" = ");
    if (line.rfind("[cam_", 0) == 0) {
      rig.cameras.emplace_back();
      rig.cameras.back().camera.name = line.substr(1, 6);
    }
    if (equals == std::string::npos || rig.cameras.empty() || line.rfind("adjusted", 0) == 0) continue;
    const std::string key = line.substr(0, equals);
    const std::vector<double> v = NumbersIn(line.substr(equals + 3));
    geometry::RigCamera& camera = rig.cameras.back();
    if (key == "size") camera.camera.width_px = static_cast<int>(v[0]), camera.camera.height_px = static_cast<int>(v[1]);
    if (key == "matrix") camera.camera.params = (Eigen::VectorXd(8) << v[0], v[4], v[2], v[5], 0, 0, 0, 0).finished();
    if (key == "distortions") camera.camera.params.tail<4>() << v[0], v[1], v[2], v[3];
    if (key == "rotation") camera.cam_from_world.rotation = geometry::RotationExp({v[0], v[1], v[2]});
    if (key == "translation") camera.cam_from_world.translation = {v[0], v[1], v[2]};
    camera.camera.model = geometry::LensModel::kBrown4;
  }
  return rig;
}

/// `trial`: balancing or static; `poses`: pose-associated (one person) or pose (all people).
inline Recording LoadPose2Sim(const std::string& trial, const std::string& poses = "pose-associated") {
  const std::string root = testing::DataRoot() + "/pose2sim";
  Recording recording{ReadQualisysToml(root + "/calibration/Calib_qualisys.toml"), {}};
  std::map<int, DetectedFrame> frames;
  for (size_t c = 0; c < 4; ++c) {
    const std::string folder = root + "/" + trial + "/" + poses + "/cam0" + std::to_string(c + 1) + "_json";
    AddTrack(dataset::ReadOpenPoseFolder(folder, recording.rig.cameras[c].camera.name, geometry::SkeletonByName("body25b")), c,
             4, &frames);
  }
  recording.frames = ToList(frames);
  return recording;
}

/// Ten cameras, BODY_25, frames 0-61 one motion and 62-119 another.
inline Recording LoadPersonA() {
  const std::string root = testing::DataRoot() + "/person_a";
  Recording recording{dataset::ReadPanopticCalibration(root + "/calibration_person_a.json"), {}};
  std::map<int, DetectedFrame> frames;
  for (size_t c = 0; c < recording.rig.cameras.size(); ++c) {
    const std::string& name = recording.rig.cameras[c].camera.name;
    AddTrack(dataset::ReadOpenPoseFolder(root + "/pose2d/" + name, name, geometry::SkeletonByName("body25")), c,
             recording.rig.cameras.size(), &frames);
  }
  recording.frames = ToList(frames);
  return recording;
}

/// Adds to the frame numbers of each camera.
inline std::vector<DetectedFrame> Renumber(const std::vector<DetectedFrame>& frames, const std::vector<int>& add) {
  std::map<int, DetectedFrame> renumbered;
  for (const DetectedFrame& frame : frames) {
    for (size_t c = 0; c < frame.people.size(); ++c) {
      DetectedFrame& target = renumbered[frame.frame + add[c]];
      target.frame = frame.frame + add[c];
      target.people.resize(frame.people.size());
      target.people[c] = frame.people[c];
    }
  }
  return ToList(renumbered);
}

}  // namespace mvstudio::triangulate
