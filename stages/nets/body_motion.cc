#include "stages/nets/body_motion.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "avatar/body/files/atlas.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::stages {
namespace {

constexpr int kTextureSidesPx[] = {1024, 768, 512, 256}, kTextureQuality = 85;
constexpr size_t kMostTextureBytes = size_t{256} << 10;
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

/// As large as fits.
std::string SmallJpeg(const Image& atlas) {
  std::string jpeg;
  for (const int side_px : kTextureSidesPx) {
    jpeg = dataset::EncodeImage(dataset::Reduced(atlas, side_px), "texture.jpg", kTextureQuality);
    if (jpeg.size() <= kMostTextureBytes) break;
  }
  return jpeg;
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

std::string BodyTexture(const body::TexturedPerson& person) {
  const int chart_px = person.textures[0].width;
  if (chart_px < 2) return {};
  const body::AtlasMesh mesh = body::UnwrapOntoAtlas(person.person.body, chart_px);
  const std::string jpeg = SmallJpeg(body::AtlasImage(person.textures));
  std::string out = "MVBTEX01";
  for (const size_t count : {mesh.vertices.size(), static_cast<size_t>(mesh.faces.cols()), jpeg.size()})
    AddNumber(static_cast<uint32_t>(count), &out);
  for (const int vertex : mesh.vertices) AddNumber(static_cast<uint32_t>(vertex), &out);
  for (Eigen::Index k = 0; k < mesh.uv.size(); ++k)
    AddNumber(static_cast<uint16_t>(std::lround(65535 * std::clamp(mesh.uv.data()[k], 0.f, 1.f))), &out);
  for (Eigen::Index k = 0; k < mesh.faces.size(); ++k) AddNumber(static_cast<uint32_t>(mesh.faces.data()[k]), &out);
  return out + jpeg;
}

}  // namespace mvstudio::stages
