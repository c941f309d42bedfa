#include "stages/nets/body_motion.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace mvstudio::stages {
namespace {

constexpr size_t kMostBytes = size_t{4} << 20, kBytesOfHeader = 48, kBytesOfFace = 12, kBytesOfVertex = 14, kBytesOfBone = 20;

template <class T>
void AddNumber(T value, std::string* out) {
  out->append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// As many frames as fit, evenly spread.
std::vector<std::pair<int, body::BodyPose>> PosesThatFit(const body::PersonBody& person) {
  const body::BodyTemplate& body = person.body;
  const auto bones = body.bone_names.size();
  const size_t rest = kBytesOfHeader + kBytesOfFace * static_cast<size_t>(body.faces.cols()) +
                      kBytesOfVertex * static_cast<size_t>(body.vertices.cols());
  std::vector<std::pair<int, body::BodyPose>> poses;
  if (bones == 0 || bones > 255 || rest >= kMostBytes) return poses;
  const size_t most = (kMostBytes - rest) / (4 + kBytesOfBone * bones);
  if (most == 0) return poses;
  const size_t stride = (person.seen.size() + most - 1) / most;
  size_t count = 0;
  for (const auto& [frame, pose] : person.seen) {
    if (count++ % stride == 0) poses.emplace_back(frame, body::ToBodyPose(body, pose));
  }
  return poses;
}

void AddPoses(const std::vector<std::pair<int, body::BodyPose>>& poses, std::string* out) {
  for (const auto& [frame, pose] : poses) {
    for (const geometry::Rigid3& bone : pose.bone_transforms)
      for (int k = 0; k < 3; ++k) AddNumber(static_cast<float>(bone.translation[k]), out);
  }
  for (const auto& [frame, pose] : poses) {
    for (const geometry::Rigid3& bone : pose.bone_transforms)
      for (int k = 0; k < 4; ++k) AddNumber(static_cast<int16_t>(std::lround(32767 * bone.rotation.coeffs()[k])), out);
  }
}

void AddSurface(const body::BodyTemplate& body, const Eigen::Vector3f& low, const Eigen::Vector3f& high, std::string* out) {
  for (Eigen::Index k = 0; k < body.vertices.size(); ++k) {
    const float extent = high[k % 3] - low[k % 3];
    const float share = extent > 0 ? (body.vertices.data()[k] - low[k % 3]) / extent : 0.f;
    AddNumber(static_cast<uint16_t>(std::lround(65535 * share)), out);
  }
  for (Eigen::Index k = 0; k < body.skin_bones.size(); ++k) AddNumber(static_cast<uint8_t>(body.skin_bones.data()[k]), out);
  for (Eigen::Index k = 0; k < body.skin_weights.size(); ++k)
    AddNumber(static_cast<uint8_t>(std::lround(255 * std::clamp(body.skin_weights.data()[k], 0.f, 1.f))), out);
}

}  // namespace

std::string BodyMotion(const body::PersonBody& person) {
  const body::BodyTemplate& body = person.body;
  const auto poses = PosesThatFit(person);
  if (poses.empty() || !body.vertices.allFinite()) return {};
  std::string out = "MVBODY01";
  for (const size_t count : {static_cast<size_t>(body.vertices.cols()), static_cast<size_t>(body.faces.cols()),
                             body.bone_names.size(), poses.size()})
    AddNumber(static_cast<uint32_t>(count), &out);
  const Eigen::Vector3f low = body.vertices.rowwise().minCoeff(), high = body.vertices.rowwise().maxCoeff();
  for (const Eigen::Vector3f& corner : {low, high})
    for (int k = 0; k < 3; ++k) AddNumber(corner[k], &out);
  for (const auto& [frame, pose] : poses) AddNumber(static_cast<int32_t>(frame), &out);
  for (Eigen::Index k = 0; k < body.faces.size(); ++k) AddNumber(static_cast<uint32_t>(body.faces.data()[k]), &out);
  AddPoses(poses, &out);
  AddSurface(body, low, high, &out);
  return out;
}

}  // namespace mvstudio::stages
