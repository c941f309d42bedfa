// Private: for colmap_files.cc.
#pragma once

#include <algorithm>
#include <cstring>

#include "calib/formats/colmap/colmap_files.h"

/// Rigs and frames of COLMAP 3.12: the same fields in text and bytes. A source has Id (32 bits), DataId (64), IsCamera, Flag,
/// Number and Here; a sink has the same names with the value to write, and Camera.
namespace mvstudio::calib::internal {

template <class T>
void Append(T value, std::string* bytes) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes->append(raw, sizeof(T));
}

struct TextSink {
  std::string text;
  void Id(uint32_t id) { Word(std::to_string(id)); }
  void DataId(uint64_t id) { Word(std::to_string(id)); }
  void Camera() { Word("CAMERA"); }
  void Flag(bool on) { Word(on ? "1" : "0"); }
  void Number(double value) { Word(NumberText(value)); }
  void Word(const std::string& word) { text += (text.empty() || text.back() == '\n' ? "" : " ") + word; }
};

struct ByteSink {
  std::string bytes;
  void Id(uint32_t id) { Append(id, &bytes); }
  void DataId(uint64_t id) { Append(id, &bytes); }
  void Camera() { Append<int32_t>(0, &bytes); }
  void Flag(bool on) { Append<uint8_t>(on ? 1 : 0, &bytes); }
  void Number(double value) { Append(value, &bytes); }
};

template <class Source>
geometry::Rigid3 ReadPose(Source* in) {
  double values[7];
  for (double& value : values) value = in->Number();
  return {ColmapRotation(values[0], values[1], values[2], values[3], in->Here()), {values[4], values[5], values[6]}};
}

template <class Sink>
void WritePose(const geometry::Rigid3& pose, Sink* out) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  for (const double value : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) out->Number(value);
}

/// RIG_ID NUM_SENSORS REF_TYPE REF_ID, then TYPE ID HAS_POSE [QW QX QY QZ TX TY TZ] of each other sensor.
template <class Source>
ColmapRig ReadRig(Source* in) {
  ColmapRig rig{in->Id(), {}};
  const uint32_t count = in->Id();
  for (uint32_t i = 0; i < count; ++i) {
    const bool camera = in->IsCamera();
    ColmapSensor sensor{in->Id(), geometry::Rigid3()};
    if (i > 0 && !in->Flag())
      sensor.sensor_from_rig.reset();
    else if (i > 0)
      sensor.sensor_from_rig = ReadPose(in);
    if (camera) rig.cameras.push_back(sensor);
  }
  return rig;
}

/// The first camera is the reference.
template <class Sink>
void WriteRig(const ColmapRig& rig, Sink* out) {
  out->Id(rig.id), out->Id(static_cast<uint32_t>(rig.cameras.size()));
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    out->Camera(), out->Id(rig.cameras[i].camera_id);
    if (i == 0) continue;
    out->Flag(rig.cameras[i].sensor_from_rig.has_value());
    if (rig.cameras[i].sensor_from_rig) WritePose(*rig.cameras[i].sensor_from_rig, out);
  }
}

/// FRAME_ID RIG_ID QW QX QY QZ TX TY TZ NUM_DATA_IDS, then SENSOR_TYPE SENSOR_ID DATA_ID of each.
template <class Source>
ColmapFrame ReadFrame(Source* in) {
  ColmapFrame frame;
  frame.place = in->Here();
  frame.id = in->Id(), frame.rig_id = in->Id();
  frame.rig_from_world = ReadPose(in);
  for (uint32_t left = in->Id(); left > 0; --left) {
    const bool camera = in->IsCamera();
    in->Id();
    const uint64_t data = in->DataId();
    if (camera) frame.images.push_back(data);
  }
  return frame;
}

/// `model` has the images of the frame.
template <class Sink>
void WriteFrame(const ColmapFrame& frame, const ColmapFiles& model, Sink* out) {
  out->Id(frame.id), out->Id(frame.rig_id);
  WritePose(frame.rig_from_world, out);
  out->Id(static_cast<uint32_t>(frame.images.size()));
  for (const ColmapImage& image : model.images) {
    if (std::find(frame.images.begin(), frame.images.end(), image.id) == frame.images.end()) continue;
    out->Camera(), out->Id(image.camera_id), out->DataId(image.id);
  }
}

}  // namespace mvstudio::calib::internal
