#include <algorithm>

#include "core/disk/files.h"
#include "core/join.h"
#include "core/statistics.h"
#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic_json.h"
#include "dataset/panoptic/panoptic_units.h"

namespace mvstudio::dataset {
namespace {

using internal::Json;
using internal::JsonView;
using internal::NumbersText;

std::optional<std::vector<double>> OptionalNumbers(const JsonView& object, const char* key, size_t count) {
  if (!object.Has(key)) return std::nullopt;
  const JsonView list = object[key];
  if (list.ArraySize() != count)
    list.Fail("must hold " + std::to_string(count) + " numbers, holds " + std::to_string(list.ArraySize()));
  return list.Numbers();
}

std::vector<std::vector<int>> ReadVisibility(const JsonView& list, size_t count) {
  if (list.ArraySize() != count)
    list.Fail("must hold " + std::to_string(count) + " lists, holds " + std::to_string(list.ArraySize()));
  std::vector<std::vector<int>> visibility(count);
  for (size_t i = 0; i < count; ++i) {
    const JsonView cameras = list[i];
    for (size_t c = 0; c < cameras.ArraySize(); ++c) visibility[i].push_back(cameras[c].Int());
  }
  return visibility;
}

PanopticLandmarks ReadLandmarks(const JsonView& json, size_t count) {
  internal::RequireObject(json);
  PanopticLandmarks landmarks;
  const JsonView list = json["landmarks"];
  if (list.ArraySize() != 3 * count) {
    list.Fail("must hold " + std::to_string(3 * count) + " numbers (x, y, z of " + std::to_string(count) + " points), holds " +
              std::to_string(list.ArraySize()));
  }
  landmarks.landmarks_cm = list.Numbers();
  landmarks.average_score = OptionalNumbers(json, "averageScore", count);
  landmarks.average_error_px = OptionalNumbers(json, "averageReproError", count);
  if (json.Has("visibility")) landmarks.visibility = ReadVisibility(json["visibility"], count);
  landmarks.extras = internal::ExtrasOf(json, {"landmarks", "averageScore", "averageReproError", "visibility"});
  return landmarks;
}

struct Part {
  const char* key;
  size_t count;
  std::optional<PanopticLandmarks> PanopticLandmarkPerson::*member;
};
constexpr Part kParts[] = {{"face70", 70, &PanopticLandmarkPerson::face70},
                           {"left_hand", 21, &PanopticLandmarkPerson::left_hand},
                           {"right_hand", 21, &PanopticLandmarkPerson::right_hand}};

PanopticLandmarkPerson ReadPerson(const JsonView& json) {
  internal::RequireObject(json);
  PanopticLandmarkPerson person;
  person.id = json["id"].Int();
  for (const Part& part : kParts) {
    if (json.Has(part.key)) person.*part.member = ReadLandmarks(json[part.key], part.count);
  }
  person.extras = internal::ExtrasOf(json, {"id", "face70", "left_hand", "right_hand"});
  return person;
}

std::string VisibilityText(const std::vector<std::vector<int>>& visibility) {
  std::string text = "[";
  for (size_t i = 0; i < visibility.size(); ++i) {
    text += (i ? ", [" : "[") + Join(visibility[i], ",", [](int camera) { return std::to_string(camera); }) + "]";
  }
  return text + "]";
}

std::string LandmarksText(const PanopticLandmarks& landmarks) {
  std::string text = "{\"landmarks\": [" + NumbersText(landmarks.landmarks_cm) + "]";
  if (landmarks.average_score) text += ",\n\"averageScore\": [" + NumbersText(*landmarks.average_score) + "]";
  if (landmarks.average_error_px) text += ",\n\"averageReproError\": [" + NumbersText(*landmarks.average_error_px) + "]";
  if (landmarks.visibility) text += ",\n\"visibility\": " + VisibilityText(*landmarks.visibility);
  return text + internal::ExtrasText(landmarks.extras) + "}";
}

std::string PersonText(const PanopticLandmarkPerson& person) {
  std::string text = "{ \"id\": " + std::to_string(person.id);
  for (const Part& part : kParts) {
    const auto& landmarks = person.*part.member;
    if (landmarks) text += std::string(",\n\"") + part.key + "\": " + LandmarksText(*landmarks);
  }
  return text + internal::ExtrasText(person.extras) + "\n}";
}

}  // namespace

PanopticLandmarkFile ParsePanopticLandmarks(std::string_view text, const std::string& path) {
  const Json json = internal::ParseJson(text, path);
  const JsonView view(path, json);
  internal::RequireObject(view);
  PanopticLandmarkFile file;
  const JsonView people = view["people"];
  for (size_t i = 0; i < people.ArraySize(); ++i) file.people.push_back(ReadPerson(people[i]));
  file.extras = internal::ExtrasOf(view, {"people"});
  return file;
}

PanopticLandmarkFile ReadPanopticLandmarks(const std::string& path) {
  return ParsePanopticLandmarks(internal::ReadTextFile(path, internal::kMaxLandmarkBytes), path);
}

std::string ToText(const PanopticLandmarkFile& file) {
  std::string text = "{ \"people\" :\n[";
  for (size_t i = 0; i < file.people.size(); ++i) text += (i ? ",\n" : "\n") + PersonText(file.people[i]);
  return text + "\n]" + internal::ExtrasText(file.extras) + " }";
}

void WritePanopticLandmarks(const PanopticLandmarkFile& file, const std::string& path) { WriteFileAtomic(path, ToText(file)); }

double MeanScore(const PanopticLandmarks& landmarks) {
  if (!landmarks.average_score || landmarks.average_score->empty()) return 0;
  return Mean(*landmarks.average_score);
}

Eigen::Matrix3Xd InWorld(const PanopticLandmarks& landmarks) {
  const std::vector<double>& cm = landmarks.landmarks_cm;
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(cm.size() / 3));
  for (size_t i = 0; i + 2 < cm.size(); i += 3)
    points.col(static_cast<Eigen::Index>(i / 3)) = internal::OursFromPanopticCm(cm[i], cm[i + 1], cm[i + 2]);
  return points;
}

}  // namespace mvstudio::dataset
