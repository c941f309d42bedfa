#include "avatar/splats/files/player_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "avatar/splats/colour.h"
#include "avatar/splats/splat_view.h"
#include "core/check.h"

namespace mvstudio::splats {
namespace {

constexpr char kMagic[] = "MVGPLAY1";
constexpr size_t kBytesOfGaussian = 21, kBytesOfFace = 12, kBytesOfVertex = 6, kBytesOfHeader = 64;
constexpr float kLeastLog = -10, kMostLog = 0;  // of the standard deviations in the file

template <class T>
void Add(T value, std::string* out) {
  out->append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// A number of [low, high] in whole steps of the type: its least for `low`, its greatest for `high`.
template <class T>
void AddScaled(float value, float low, float high, std::string* out) {
  constexpr float kSteps = static_cast<float>((size_t{1} << (8 * sizeof(T))) - 1);
  const float share = high > low ? (std::clamp(value, low, high) - low) / (high - low) : 0.f;
  Add(static_cast<T>(std::lround(share * kSteps)), out);
}

bool IsFinite(const PlayerTimeStep& time_step) { return time_step.vertices->allFinite(); }

/// As many as `most`, evenly spread, the first and the last among them.
std::vector<PlayerTimeStep> Thinned(const std::vector<PlayerTimeStep>& all, size_t most) {
  if (all.size() <= most) return all;
  std::vector<PlayerTimeStep> out;
  for (size_t k = 0; k < most; ++k) out.push_back(all[most == 1 ? 0 : k * (all.size() - 1) / (most - 1)]);
  return out;
}

void AddHeader(const Cloud& cloud, bool mip, const body::BodyTemplate& body, const std::vector<PlayerTimeStep>& shown,
               const Eigen::Vector3f& low, const Eigen::Vector3f& high, std::string* out) {
  out->append(kMagic, 8);
  for (const size_t count : {cloud.size(), static_cast<size_t>(body.faces.cols()), static_cast<size_t>(body.vertices.cols()),
                             shown.size(), static_cast<size_t>(mip)})
    Add(static_cast<uint32_t>(count), out);
  const Eigen::Vector3f up = UpOf(body, shown);
  for (const Eigen::Vector3f& vector : {low, high, up})
    for (int k = 0; k < 3; ++k) Add(vector[k], out);
}

/// 11 bytes a Gaussian, each by itself.
void AddLooks(const Cloud& cloud, std::string* out) {
  const Parameters<float>& v = cloud.values;
  const size_t colours = 3 * static_cast<size_t>(BasisSize(v.degree));
  for (size_t i = 0; i < cloud.size(); ++i) {
    SplatView<float> s;
    SmoothScales(cloud, i, &s);
    for (int k = 0; k < 3; ++k) AddScaled<uint8_t>(std::log(s.scale[k]), kLeastLog, kMostLog, out);
    const Eigen::Vector4f q = Eigen::Map<const Eigen::Vector4f>(v.rotation.data() + 4 * i).normalized();
    for (int k = 0; k < 4; ++k) AddScaled<uint8_t>(q[k], -1, 1, out);
    AddScaled<uint8_t>(s.kept / (1 + std::exp(-v.opacity[i])), 0, 1, out);
    for (size_t c = 0; c < 3; ++c)
      AddScaled<uint8_t>(0.5f + static_cast<float>(kBasis0) * v.colour[colours * i + c], 0, 1, out);
  }
}

}  // namespace

Eigen::Vector3f UpOf(const body::BodyTemplate& body, const std::vector<PlayerTimeStep>& time_steps) {
  if (time_steps.empty() || body.vertices.cols() == 0) return Eigen::Vector3f::Zero();
  const float bottom = body.vertices.row(2).minCoeff(), tenth = 0.1f * (body.vertices.row(2).maxCoeff() - bottom);
  Eigen::Vector3f up = Eigen::Vector3f::Zero();
  for (const PlayerTimeStep& time_step : time_steps) {
    Eigen::Vector3f high = Eigen::Vector3f::Zero(), low = high;
    int num_high = 0, num_low = 0;
    for (Eigen::Index i = 0; i < body.vertices.cols(); ++i) {
      const float z = body.vertices(2, i) - bottom;
      if (z >= 9 * tenth) high += time_step.vertices->col(i), ++num_high;
      if (z <= tenth) low += time_step.vertices->col(i), ++num_low;
    }
    up += (high / static_cast<float>(num_high) - low / static_cast<float>(num_low)).normalized();
  }
  up.normalize();
  Eigen::Index axis = 0;
  const float most = up.cwiseAbs().maxCoeff(&axis);
  constexpr float kNear = 0.906f;  // cos 25 degrees
  return most >= kNear ? Eigen::Vector3f(Eigen::Vector3f::Unit(axis) * std::copysign(1.f, up[axis])) : up;
}

std::string PlayerBytes(const Cloud& cloud, bool mip, const body::BodyTemplate& body,
                        const std::vector<PlayerTimeStep>& time_steps, const PlayerLimits& limits) {
  CheckCloud(cloud, static_cast<int>(body.faces.cols()));
  std::vector<PlayerTimeStep> sound;
  for (const PlayerTimeStep& time_step : time_steps) {
    MVS_CHECK(time_step.vertices && time_step.vertices->cols() == body.vertices.cols(), "an instant of another body");
    if (IsFinite(time_step)) sound.push_back(time_step);
  }
  const size_t one = kBytesOfVertex * static_cast<size_t>(body.vertices.cols()) + 4;
  const size_t rest = kBytesOfHeader + kBytesOfGaussian * cloud.size() + kBytesOfFace * static_cast<size_t>(body.faces.cols());
  if (sound.empty() || limits.bytes < rest + one) return {};
  const std::vector<PlayerTimeStep> shown = Thinned(sound, std::min(limits.time_steps, (limits.bytes - rest) / one));
  if (shown.empty()) return {};
  Eigen::Vector3f low = shown[0].vertices->rowwise().minCoeff(), high = shown[0].vertices->rowwise().maxCoeff();
  for (const PlayerTimeStep& time_step : shown) {
    low = low.cwiseMin(time_step.vertices->rowwise().minCoeff());
    high = high.cwiseMax(time_step.vertices->rowwise().maxCoeff());
  }
  std::string out;
  AddHeader(cloud, mip, body, shown, low, high, &out);
  for (const PlayerTimeStep& time_step : shown) Add(static_cast<int32_t>(time_step.frame), &out);
  for (Eigen::Index k = 0; k < body.faces.size(); ++k) Add(static_cast<uint32_t>(body.faces.data()[k]), &out);
  for (const int face : cloud.face) Add(static_cast<uint32_t>(face), &out);
  for (const PlayerTimeStep& time_step : shown)
    for (Eigen::Index k = 0; k < time_step.vertices->size(); ++k)
      AddScaled<uint16_t>(time_step.vertices->data()[k], low[k % 3], high[k % 3], &out);
  for (const float place : cloud.values.place) AddScaled<uint16_t>(place, -0.5f, 1.5f, &out);
  for (const float offset : cloud.values.offset) AddScaled<uint16_t>(offset, -0.1f, 0.1f, &out);
  AddLooks(cloud, &out);
  return out;
}

}  // namespace mvstudio::splats
