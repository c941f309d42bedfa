#include "dataset/panoptic/own_joints.h"

#include <cmath>
#include <filesystem>
#include <vector>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/format.h"
#include "dataset/panoptic/panoptic_json.h"
#include "dataset/panoptic/panoptic_units.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using internal::Json;
using internal::JsonView;

constexpr char kPrefix[] = "hdPose3d_stage1_";
constexpr char kSkeletonFile[] = "skeleton.json";

std::string JointsKey(const geometry::Skeleton& skeleton) { return "joints" + std::to_string(skeleton.joints.size()); }

std::string OwnBodyText(int id, const JointsPose& pose, const std::string& key) {
  std::vector<double> numbers;
  for (size_t j = 0; j < pose.valid.size(); ++j) {
    if (!pose.valid[j]) {
      numbers.insert(numbers.end(), {0, 0, 0, -1});
      continue;
    }
    const Eigen::Vector3d x = pose.x_in_world.col(static_cast<Eigen::Index>(j));
    for (const double metres : {x[0], -x[2], x[1]}) numbers.push_back(internal::Centimetres(metres == 0 ? 0 : metres));
    numbers.push_back(pose.confidence[j]);
  }
  return "{ \"id\": " + std::to_string(id) + ",\n\"" + key + "\": [" + internal::NumbersText(numbers) + "]\n}";
}

std::string OwnSceneText(const std::map<int, JointsPose>& people, const std::string& key, double time_ms) {
  std::string text =
      "{ \"version\": 0.7, \n\"univTime\" :" + internal::NumberText(time_ms) + ",\n\"fpsType\" :\"hd_29_97\",\n\"bodies\" :\n[";
  bool first = true;
  for (const auto& [id, pose] : people) {
    text += (first ? "\n" : ",\n") + OwnBodyText(id, pose, key);
    first = false;
  }
  return text + "\n] }";
}

JointsPose PoseOfNumbers(const JsonView& list, size_t count) {
  if (list.ArraySize() != 4 * count) {
    list.Fail("must hold " + std::to_string(4 * count) + " numbers (x, y, z, c of " + std::to_string(count) +
              " joints), holds " + std::to_string(list.ArraySize()));
  }
  const std::vector<double> numbers = list.Numbers();
  JointsPose pose;
  pose.x_in_world = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(count));
  pose.valid.assign(count, false), pose.confidence.assign(count, 0);
  for (size_t j = 0; j < count; ++j) {
    const double* v = &numbers[4 * j];
    for (size_t k = 0; k < 4; ++k) {
      if (!std::isfinite(v[k])) list[4 * j + k].Fail("must be finite");
    }
    pose.valid[j] = v[3] >= 0;
    if (!pose.valid[j]) continue;
    pose.x_in_world.col(static_cast<Eigen::Index>(j)) = internal::OursFromPanopticCm(v[0], v[1], v[2]);
    pose.confidence[j] = v[3];
  }
  return pose;
}

}  // namespace

std::string OwnJointsFolder(const std::string& skeleton) { return kPrefix + skeleton; }

std::string FindOwnJoints(const std::string& root) {
  std::string found;
  for (const std::string& name : NamesIn(root)) {
    const std::string folder = (fs::path(root) / name).string();
    if (name.rfind(kPrefix, 0) != 0 || !fs::is_regular_file(fs::path(folder) / kSkeletonFile)) continue;
    if (!found.empty()) {
      throw FormatError(root, "",
                        "holds joints of two skeletons (" + fs::path(found).filename().string() + ", " + name +
                            "); keep one beside hdPose3d_stage1_coco19");
    }
    found = folder;
  }
  return found;
}

void WriteOwnJoints(const OwnJoints& joints, double frame_rate_hz, const std::string& root) {
  const fs::path folder = fs::path(root) / OwnJointsFolder(joints.skeleton.name);
  const std::string key = JointsKey(joints.skeleton);
  WriteFileAtomic((folder / kSkeletonFile).string(), geometry::SkeletonToJson(joints.skeleton) + "\n");
  for (const auto& [frame, people] : joints.poses) {
    WriteFileAtomic((folder / Format("body3DScene_%08d.json", frame)).string(),
                    OwnSceneText(people, key, 1000.0 * frame / frame_rate_hz));
  }
}

std::map<int, JointsPose> ReadOwnScene(const std::string& path, const geometry::Skeleton& skeleton) {
  constexpr int64_t kMostBytes = int64_t{64} << 20;
  const Json json = internal::ParseJsonFile(path, kMostBytes);
  const JsonView bodies = JsonView(path, json)["bodies"];
  const std::string key = JointsKey(skeleton);
  std::map<int, JointsPose> people;
  for (size_t i = 0; i < bodies.ArraySize(); ++i) {
    const int id = bodies[i]["id"].Int();
    if (id < 0) continue;
    if (!people.emplace(id, PoseOfNumbers(bodies[i][key.c_str()], skeleton.joints.size())).second) {
      bodies[i]["id"].Fail(std::to_string(id) + " is there twice");
    }
  }
  return people;
}

OwnJoints ListOwnJoints(const std::string& folder) {
  const std::string prefix = "body3DScene_", path = (fs::path(folder) / kSkeletonFile).string();
  OwnJoints joints;
  joints.skeleton = geometry::SkeletonFromJson(internal::ReadTextFile(path, geometry::kMaxSkeletonBytes), path, "");
  for (const std::string& file : FilesNamed(folder, prefix, ".json")) {
    const std::string digits = fs::path(file).stem().string().substr(prefix.size());
    if (digits.size() != 8 || digits.find_first_not_of("0123456789") != std::string::npos) continue;
    joints.files[std::stoi(digits)] = file;
  }
  return joints;
}

std::optional<OwnJoints> ReadOwnJoints(const std::string& root) {
  const std::string folder = FindOwnJoints(root);
  if (folder.empty()) return std::nullopt;
  OwnJoints joints = ListOwnJoints(folder);
  for (const auto& [frame, path] : joints.files) joints.poses[frame] = ReadOwnScene(path, joints.skeleton);
  return joints;
}

}  // namespace mvstudio::dataset
