#include "stages/view/moving_body.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::stages {
namespace {

constexpr char kMotionMagic[] = "MVBODY01";
constexpr uint64_t kMostCount = 1'000'000;  // of a kind: their product stays far from 2^64

/// Numbers one after the other; its length was checked.
class MotionBytes {
 public:
  explicit MotionBytes(const std::string& bytes) : at_(bytes.data() + sizeof(kMotionMagic) - 1) {}
  template <class T>
  T Take() {
    T value;
    std::memcpy(&value, at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  template <class T, class Matrix>
  void Fill(Matrix* matrix, double scale) {
    for (Eigen::Index k = 0; k < matrix->size(); ++k)
      matrix->data()[k] = static_cast<typename Matrix::Scalar>(Take<T>() * scale);
  }

 private:
  const char* at_;
};

struct MotionCounts {
  uint64_t vertices = 0, faces = 0, bones = 0, frames = 0;
  uint64_t NumBytes() const { return 48 + 4 * frames + 12 * faces + 20 * bones * frames + 14 * vertices; }
};

MotionCounts CountsOf(const std::string& path, const std::string& bytes) {
  if (bytes.size() < 48 || bytes.compare(0, sizeof(kMotionMagic) - 1, kMotionMagic) != 0)
    throw FormatError(path, "", "is no body in motion: make it anew by mvstudio avatar fit");
  MotionBytes in(bytes);
  MotionCounts counts;
  for (uint64_t* count : {&counts.vertices, &counts.faces, &counts.bones, &counts.frames}) *count = in.Take<uint32_t>();
  const uint64_t most = std::max({counts.vertices, counts.faces, counts.bones, counts.frames});
  if (most > kMostCount || counts.bones > 255 || counts.NumBytes() != bytes.size())
    throw FormatError(path, "",
                      "has " + std::to_string(bytes.size()) + " bytes, not what its header says: it was cut, or changed");
  return counts;
}

void ReadPoses(const MotionCounts& counts, MotionBytes* in, MovingBody* body) {
  body->at_frame.assign(counts.frames, std::vector<geometry::Rigid3>(counts.bones));
  for (auto& bones : body->at_frame)
    for (geometry::Rigid3& bone : bones)
      for (int k = 0; k < 3; ++k) bone.translation[k] = in->Take<float>();
  for (auto& bones : body->at_frame) {
    for (geometry::Rigid3& bone : bones) {
      for (int k = 0; k < 4; ++k) bone.rotation.coeffs()[k] = in->Take<int16_t>() / 32767.0;
      bone.rotation.normalize();
    }
  }
}

void CheckIndices(const std::string& path, const MotionCounts& counts, const MovingBody& body) {
  const auto beyond = [](const auto& indices, uint64_t count) {
    return indices.size() > 0 && (indices.minCoeff() < 0 || static_cast<uint64_t>(indices.maxCoeff()) >= count);
  };
  if (beyond(body.faces, counts.vertices) || beyond(body.bones, counts.bones))
    throw FormatError(path, "", "names a vertex or a bone that it does not have: it was changed");
  if (!std::is_sorted(body.frames.begin(), body.frames.end()))
    throw FormatError(path, "", "has frames that do not ascend: it was changed");
}

/// Twice the usual distance of its frames.
int LongestGap(const std::vector<int>& frames) {
  std::vector<int> gaps;
  for (size_t i = 1; i < frames.size(); ++i) gaps.push_back(frames[i] - frames[i - 1]);
  std::sort(gaps.begin(), gaps.end());
  return 2 * (gaps.empty() ? 1 : gaps[gaps.size() / 2]);
}

std::optional<size_t> NearestFrame(const std::vector<int>& frames, int frame) {
  const auto next = std::lower_bound(frames.begin(), frames.end(), frame);
  if (next == frames.end() || (next == frames.begin() && *next != frame)) return std::nullopt;
  const auto at = static_cast<size_t>(next - frames.begin());
  if (*next == frame) return at;
  if (*next - frames[at - 1] > LongestGap(frames)) return std::nullopt;
  return frame - frames[at - 1] < *next - frame ? at - 1 : at;
}

}  // namespace

MovingBody ReadMovingBody(const std::string& path) {
  const std::string bytes = ReadFile(path);
  const MotionCounts counts = CountsOf(path, bytes);
  MotionBytes in(bytes);
  for (int k = 0; k < 4; ++k) in.Take<uint32_t>();
  MovingBody body;
  Eigen::Vector3d low, high;
  in.Fill<float>(&low, 1), in.Fill<float>(&high, 1);
  for (uint64_t f = 0; f < counts.frames; ++f) body.frames.push_back(in.Take<int32_t>());
  const auto num_vertices = static_cast<Eigen::Index>(counts.vertices);
  body.faces.resize(3, static_cast<Eigen::Index>(counts.faces));
  for (Eigen::Index k = 0; k < body.faces.size(); ++k)
    body.faces.data()[k] = static_cast<int>(std::min<uint32_t>(in.Take<uint32_t>(), kMostCount));
  ReadPoses(counts, &in, &body);
  body.rest.resize(3, num_vertices), body.bones.resize(4, num_vertices), body.weights.resize(4, num_vertices);
  in.Fill<uint16_t>(&body.rest, 1 / 65535.0);
  body.rest = ((high - low).asDiagonal() * body.rest).colwise() + low;
  in.Fill<uint8_t>(&body.bones, 1), in.Fill<uint8_t>(&body.weights, 1);
  for (Eigen::Index v = 0; v < num_vertices; ++v) body.weights.col(v) /= std::max(1.0, body.weights.col(v).sum());
  CheckIndices(path, counts, body);
  return body;
}

std::optional<Eigen::Matrix3Xd> BodyAt(const MovingBody& body, int frame) {
  const auto at = NearestFrame(body.frames, frame);
  if (!at) return std::nullopt;
  const std::vector<geometry::Rigid3>& world_from_body = body.at_frame[*at];
  Eigen::Matrix3Xd x_in_world = Eigen::Matrix3Xd::Zero(3, body.rest.cols());
  for (Eigen::Index v = 0; v < body.rest.cols(); ++v) {
    for (int k = 0; k < 4; ++k) {
      if (body.weights(k, v) > 0)
        x_in_world.col(v) +=
            body.weights(k, v) * (world_from_body[static_cast<size_t>(body.bones(k, v))] * Eigen::Vector3d(body.rest.col(v)));
    }
  }
  return x_in_world;
}

}  // namespace mvstudio::stages
