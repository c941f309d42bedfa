#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/format.h"
#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic_json.h"
#include "dataset/panoptic/panoptic_units.h"

namespace mvstudio::dataset {
namespace {

using internal::Json;
using internal::JsonText;
using internal::JsonView;
using internal::NumbersText;
using internal::OptionalNumber;
using internal::OptionalText;
using internal::RequireObject;
using internal::StreamNumberText;

constexpr std::pair<const char*, size_t> kSkeletons[] = {{"joints19", 19}, {"joints26", 26}, {"joints15", 15}};

/// "%0.3f" as CMU writes times, or more where that is another number.
std::string TimeText(double time_ms) {
  const std::string text = Format("%0.3f", time_ms);
  return std::strtod(text.c_str(), nullptr) == time_ms ? text : StreamNumberText(time_ms);
}

std::vector<double>& JointsOf(PanopticBody& body, size_t skeleton) {
  return skeleton == 0 ? body.joints19 : skeleton == 1 ? body.joints26 : body.joints15;
}

/// x, y, z, c of every joint. One with a null is missing, as CMU writes it: c = -1.
std::vector<double> NumbersOf(const JsonView& joints, int* num_without_numbers) {
  std::vector<double> numbers;
  for (size_t i = 0; i + 3 < joints.ArraySize(); i += 4) {
    bool missing = false;
    for (size_t k = i; k < i + 4; ++k) {
      missing = missing || joints.value()[k].is_null();
      numbers.push_back(joints.value()[k].is_null() ? 0 : joints[k].Number());
    }
    if (missing) std::fill(numbers.end() - 4, numbers.end(), 0), numbers.back() = -1;
    *num_without_numbers += missing;
  }
  return numbers;
}

PanopticBody ReadBody(const JsonView& json) {
  RequireObject(json);
  PanopticBody body;
  body.id = json["id"].Int();
  bool any = false;
  for (size_t s = 0; s < std::size(kSkeletons); ++s) {
    const auto& [key, count] = kSkeletons[s];
    if (!json.Has(key)) continue;
    any = true;
    const JsonView joints = json[key];
    if (joints.ArraySize() != 4 * count) {
      joints.Fail("must hold " + std::to_string(4 * count) + " numbers (x, y, z, c of " + std::to_string(count) +
                  " joints), holds " + std::to_string(joints.ArraySize()));
    }
    JointsOf(body, s) = NumbersOf(joints, &body.num_without_numbers);
  }
  if (!any) json["joints19"];  // throws: it is missing
  body.extras = internal::ExtrasOf(json, {"id", "joints19", "joints26", "joints15"});
  return body;
}

std::string BodyText(const PanopticBody& body) {
  std::string text = "{ \"id\": " + std::to_string(body.id);
  const std::vector<double>* joints[] = {&body.joints19, &body.joints26, &body.joints15};
  for (size_t s = 0; s < std::size(kSkeletons); ++s) {
    if (!joints[s]->empty()) text += std::string(",\n\"") + kSkeletons[s].first + "\": [" + NumbersText(*joints[s]) + "]";
  }
  return text + internal::ExtrasText(body.extras) + "\n}";
}

Coco19Pose ToPose(const std::vector<double>& joints) {
  Coco19Pose pose;
  for (size_t j = 0; j < 19; ++j) {
    const double* v = &joints[4 * j];
    pose.valid[j] = v[3] >= 0;
    if (!pose.valid[j]) continue;
    pose.confidence[j] = v[3];
    pose.x_in_world.col(static_cast<Eigen::Index>(j)) = internal::OursFromPanopticCm(v[0], v[1], v[2]);
  }
  return pose;
}

/// No negative zeros: they come from the change of axes only.
double PlainZero(double value) { return value == 0 ? 0 : value; }

std::vector<double> ToJoints(const Coco19Pose& pose) {
  std::vector<double> joints;
  for (int j = 0; j < 19; ++j) {
    if (!pose.valid[j]) {
      joints.insert(joints.end(), {0, 0, 0, -1});
      continue;
    }
    const Eigen::Vector3d x = pose.x_in_world.col(j);
    const double confidence = pose.confidence[j];
    MVS_CHECK(x.allFinite() && std::isfinite(confidence), "joint " << j << " is marked valid and is not finite");
    MVS_CHECK(confidence >= 0, "joint " << j << " is marked valid, its confidence is " << confidence);
    for (const double metres : {x[0], -x[2], x[1]}) joints.push_back(PlainZero(internal::Centimetres(metres)));
    joints.push_back(confidence);
  }
  return joints;
}

}  // namespace

PanopticScene ParsePanopticScene(std::string_view text, const std::string& path) {
  const Json json = internal::ParseJson(text, path, true);
  const JsonView file(path, json);
  RequireObject(file);
  PanopticScene scene;
  scene.version = OptionalNumber(file, "version");
  scene.univ_time_ms = OptionalNumber(file, "univTime");
  scene.fps_type = OptionalText(file, "fpsType");
  scene.vga_video_time_ms = OptionalNumber(file, "vgaVideoTime");
  const JsonView bodies = file["bodies"];
  for (size_t i = 0; i < bodies.ArraySize(); ++i) scene.bodies.push_back(ReadBody(bodies[i]));
  scene.extras = internal::ExtrasOf(file, {"version", "univTime", "fpsType", "vgaVideoTime", "bodies"});
  return scene;
}

PanopticScene ReadPanopticScene(const std::string& path) {
  return ParsePanopticScene(internal::ReadTextFile(path, internal::kMaxSceneBytes), path);
}

std::string ToText(const PanopticScene& scene) {
  std::string text = "{ ";
  if (scene.version) text += "\"version\": " + StreamNumberText(*scene.version) + ", \n";
  if (scene.univ_time_ms) text += "\"univTime\" :" + TimeText(*scene.univ_time_ms) + ",\n";
  if (scene.fps_type) text += "\"fpsType\" :" + JsonText(*scene.fps_type) + ",\n";
  if (scene.vga_video_time_ms) text += "\"vgaVideoTime\" :" + TimeText(*scene.vga_video_time_ms) + ",\n";
  text += "\"bodies\" :\n[";
  for (size_t i = 0; i < scene.bodies.size(); ++i) text += (i ? ",\n" : "\n") + BodyText(scene.bodies[i]);
  return text + "\n]" + internal::ExtrasText(scene.extras) + " }";
}

void WritePanopticScene(const PanopticScene& scene, const std::string& path) { WriteFileAtomic(path, ToText(scene)); }

std::map<int, Coco19Pose> ToCoco19(const PanopticScene& scene, const std::string& path) {
  std::map<int, Coco19Pose> people;
  for (size_t i = 0; i < scene.bodies.size(); ++i) {
    const PanopticBody& body = scene.bodies[i];
    const std::string where = "bodies[" + std::to_string(i) + "]";
    if (body.id < 0) continue;
    if (body.joints19.empty())
      throw FormatError(path, where, "has another skeleton than joints19, which is the one that is read");
    if (!people.emplace(body.id, ToPose(body.joints19)).second)
      throw FormatError(path, where + ".id", std::to_string(body.id) + " is there twice");
  }
  return people;
}

PanopticScene ToPanopticScene(const std::map<int, Coco19Pose>& people, double univ_time_ms) {
  PanopticScene scene;
  scene.version = 0.7;
  scene.univ_time_ms = univ_time_ms;
  scene.fps_type = "hd_29_97";
  for (const auto& [id, pose] : people) {
    MVS_CHECK(id >= 0, "person id " << id);
    scene.bodies.emplace_back();
    scene.bodies.back().id = id;
    scene.bodies.back().joints19 = ToJoints(pose);
  }
  return scene;
}

}  // namespace mvstudio::dataset
