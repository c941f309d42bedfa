#include <algorithm>
#include <filesystem>
#include <set>

#include "core/disk/files.h"
#include "core/label.h"
#include "core/some_of.h"
#include "dataset/pose/pose2d_parse.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset {
namespace {

using nlohmann::json;

/// The texts of a list; empty: it is none of texts alone.
std::vector<std::string> TextsOf(const json& list) {
  std::vector<std::string> texts;
  if (!list.is_array()) return texts;
  for (const json& item : list) {
    if (!item.is_string()) return {};
    texts.push_back(item.get<std::string>());
  }
  return texts;
}

/// MMPose's {"0": "nose", …}.
std::vector<std::string> TextsByNumber(const json& table) {
  std::vector<std::string> texts;
  for (size_t k = 0; table.is_object() && k < table.size(); ++k) {
    const auto found = table.find(std::to_string(k));
    if (found == table.end() || !found->is_string()) return {};
    texts.push_back(found->get<std::string>());
  }
  return texts;
}

/// The names of keypoints {"name": "nose", "x": …}, TensorFlow's `part`; empty: not all have one.
std::vector<std::string> NamesOfPoints(const json& person) {
  std::vector<std::string> names;
  if (!person.is_object() || !person.contains("keypoints") || !person["keypoints"].is_array()) return names;
  for (const json& point : person["keypoints"]) {
    const std::string name = internal::NameOfPoint(point);
    if (name.empty()) return {};
    names.push_back(name);
  }
  return names;
}

/// Names that say something, each once: not `kp_0`, `kp_1`, ….
bool Tell(const std::vector<std::string>& names) {
  std::set<std::string> keys, stems;
  for (const std::string& name : names) {
    if (!WhyNotALabel(name).empty()) return false;
    keys.insert(geometry::JointKey(name));
    stems.insert(name.substr(0, name.find_first_of("0123456789")));
  }
  return keys.size() == names.size() && (stems.size() > 1 || names.size() == 1);
}

const json* JsonMember(const json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  return object.is_object() && found != object.end() ? &*found : nullptr;
}

/// The category whose keypoints all categories with keypoints share; null: none.
const json* SharedCategory(const json& root) {
  const json* const categories = JsonMember(root, "categories");
  const json* shared = nullptr;
  for (size_t i = 0; categories && categories->is_array() && i < categories->size(); ++i) {
    const json& category = (*categories)[i];
    const json* const keypoints = JsonMember(category, "keypoints");
    if (!keypoints || keypoints->empty()) continue;
    if (shared && (*shared)["keypoints"] != *keypoints) return nullptr;
    shared = &category;
  }
  return shared;
}

/// The names that any person's keypoints bear, each once, in the order of their first: detectors leave out what they do not
/// see. Empty: none, or a person has a joint twice.
std::vector<std::string> NamesOfAllPoints(const json& people) {
  std::vector<std::string> names;
  std::set<std::string> known;
  for (const json& person : people) {
    std::set<std::string> own;
    for (const std::string& name : NamesOfPoints(person)) {
      const std::string key = geometry::JointKey(name);
      if (!own.insert(key).second) return {};
      if (known.insert(key).second) names.push_back(name);
    }
  }
  return names;
}

std::vector<std::string> StatedNames(const json& root) {
  if (const json* const category = SharedCategory(root)) return TextsOf((*category)["keypoints"]);
  if (const json* const meta = JsonMember(root, "meta_info")) {
    const json* const names = JsonMember(*meta, "keypoint_id2name");
    return names ? TextsByNumber(*names) : std::vector<std::string>();
  }
  return root.is_array() ? NamesOfAllPoints(root) : std::vector<std::string>();
}

/// COCO's `skeleton`: pairs that count joints from 1.
void AddStatedBones(const json& root, geometry::Skeleton* skeleton) {
  const json* const category = SharedCategory(root);
  const json* const bones = category ? JsonMember(*category, "skeleton") : nullptr;
  const int count = static_cast<int>(skeleton->joints.size());
  std::set<std::pair<int, int>> seen;
  for (size_t i = 0; bones && bones->is_array() && i < bones->size(); ++i) {
    const json& bone = (*bones)[i];
    if (!bone.is_array() || bone.size() != 2 || !bone[0].is_number_integer() || !bone[1].is_number_integer()) continue;
    const std::pair<int, int> ends(bone[0].get<int>() - 1, bone[1].get<int>() - 1);
    const bool good = std::min(ends.first, ends.second) >= 0 && std::max(ends.first, ends.second) < count;
    if (good && ends.first != ends.second && seen.insert(std::minmax(ends.first, ends.second)).second)
      skeleton->bones.push_back(ends);
  }
}

}  // namespace

std::string internal::NameOfPoint(const json& point) {
  for (const char* key : {"name", "part"}) {
    const json* const name = JsonMember(point, key);
    if (name && name->is_string()) return name->get<std::string>();
  }
  return "";
}

std::optional<geometry::Skeleton> internal::StatedSkeleton(const json& root) {
  const std::vector<std::string> names = StatedNames(root);
  if (names.empty() || names.size() > geometry::kMaxSkeletonJoints || !Tell(names)) return std::nullopt;
  geometry::Skeleton skeleton = geometry::PointsSkeleton(names);
  AddStatedBones(root, &skeleton);
  return skeleton;
}

bool internal::MayLeaveOutJoints(const json& root) { return root.is_array(); }

void internal::ToAskedJoints(const geometry::Skeleton& stated, bool may_leave_out, const PoseFile& file,
                             std::vector<Person2d>* people) {
  const std::vector<std::string>& asked = file.skeleton.joints;
  const bool any = std::any_of(asked.begin(), asked.end(), [&](const auto& j) { return geometry::FindJoint(stated, j) >= 0; });
  std::vector<int> places;
  for (const std::string& joint : asked) {
    const int place = geometry::FindJoint(stated, joint);
    if (place < 0 && !(may_leave_out && any))
      file.Fail("", "the file names its joints (" + SomeOf(stated.joints) + "), and none of them is `" + joint +
                        "` of skeleton " + file.skeleton.name + "; leave option 'skeleton' out to take the file's joints");
    places.push_back(place);
  }
  for (Person2d& person : *people) {
    std::vector<Keypoint2d> keypoints;
    for (const int place : places) keypoints.push_back(place < 0 ? Keypoint2d{} : person.keypoints[static_cast<size_t>(place)]);
    person.keypoints = std::move(keypoints);
  }
}

std::optional<geometry::Skeleton> SkeletonStatedIn(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return std::nullopt;
  const std::string text = ReadFile(path);
  const auto has = [&](const char* piece) { return text.find(piece) != std::string::npos; };
  if (!has("\"keypoints\"") || !(has("\"categories\"") || has("\"meta_info\"") || has("\"name\"") || has("\"part\"")))
    return std::nullopt;
  const geometry::Skeleton none;
  std::optional<geometry::Skeleton> stated;
  try {
    stated = internal::StatedSkeleton(internal::ParsePoseJson(text, {path, "", none}));
  } catch (const FormatError&) {
    return std::nullopt;  // its reader says what is wrong
  }
  if (!stated) return stated;
  for (const std::string& known : geometry::SkeletonsOfSize(stated->joints.size())) {
    const geometry::Skeleton& skeleton = geometry::SkeletonByName(known);
    const auto named = [&](const std::string& joint) { return geometry::FindJoint(*stated, joint) >= 0; };
    if (std::all_of(skeleton.joints.begin(), skeleton.joints.end(), named)) return skeleton;
  }
  return stated;
}

}  // namespace mvstudio::dataset
