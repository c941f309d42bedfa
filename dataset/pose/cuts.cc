#include "dataset/pose/cuts.h"

#include <optional>

namespace mvstudio::dataset {
namespace {

constexpr double kFrameRateHz = 29.97;
constexpr double kJumpM = 0.5, kSpeedMPerS = 3;
constexpr int kBodyCenter = 2;

/// From a to b, metres.
std::optional<Eigen::Vector3d> Displacement(const Coco19Pose& a, const Coco19Pose& b) {
  const Eigen::Matrix<double, 3, 19> difference = b.x_in_world - a.x_in_world;
  if (a.valid[kBodyCenter] && b.valid[kBodyCenter]) return difference.col(kBodyCenter);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (int j = 0; j < 19; ++j) {
    if (a.valid[j] && b.valid[j]) sum += difference.col(j), ++count;
  }
  return count > 0 ? std::optional<Eigen::Vector3d>(sum / count) : std::nullopt;
}

}  // namespace

bool IsCut(const Coco19Pose& a, const Coco19Pose& b, int frames) {
  const std::optional<Eigen::Vector3d> moved = Displacement(a, b);
  return moved && moved->norm() > kJumpM + kSpeedMPerS * frames / kFrameRateHz;
}

std::vector<int> FindCuts(const std::map<int, Coco19Pose>& poses) {
  std::vector<int> cuts;
  for (auto it = poses.begin(); it != poses.end(); ++it) {
    const auto next = std::next(it);
    if (next != poses.end() && IsCut(it->second, next->second, next->first - it->first)) cuts.push_back(next->first);
  }
  return cuts;
}

}  // namespace mvstudio::dataset
