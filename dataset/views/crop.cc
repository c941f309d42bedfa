#include "dataset/views/crop.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::dataset {
namespace {

constexpr double kMinDepthM = 0.1;

// Metres from a joint to the body's surface, in the order of Panoptic's joints: head 0.16, hands 0.20, feet 0.18.
double Thickness(int joint) {
  switch (joint) {
    case 1:
    case 15:
    case 16:
    case 17:
    case 18:
      return 0.16;
    case 5:
    case 11:
      return 0.20;
    case 8:
    case 14:
      return 0.18;
    default:
      return 0.14;
  }
}

}  // namespace

std::array<bool, 19> PlausibleJoints(const Coco19Pose& pose) {
  std::array<bool, 19> plausible{};
  std::vector<double> coordinates[3];
  for (int j = 0; j < 19; ++j) {
    plausible[j] = pose.valid[j] && pose.x_in_world.col(j).allFinite();
    for (int k = 0; plausible[j] && k < 3; ++k) coordinates[k].push_back(pose.x_in_world(k, j));
  }
  if (coordinates[0].empty()) return plausible;
  const Eigen::Vector3d median(UpperMedian(coordinates[0]), UpperMedian(coordinates[1]), UpperMedian(coordinates[2]));
  for (int j = 0; j < 19; ++j) plausible[j] = plausible[j] && (pose.x_in_world.col(j) - median).norm() <= kMaxReachM;
  return plausible;
}

std::optional<PersonExtent> MeasurePerson(const Coco19Pose& pose, const geometry::RigCamera& camera) {
  const std::array<bool, 19> plausible = PlausibleJoints(pose);
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (int j = 0; j < 19; ++j) {
    if (!plausible[j]) continue;
    const Eigen::Vector3d x = camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j));
    if (x[2] < kMinDepthM) return std::nullopt;
    const double r = Thickness(j);
    low = low.cwiseMin(x - Eigen::Vector3d(r, r, 0)), high = high.cwiseMax(x + Eigen::Vector3d(r, r, 0));
  }
  if (!low.allFinite()) return std::nullopt;
  PersonExtent extent;
  extent.middle_in_cam = (low + high) / 2;
  const Eigen::Quaterniond crop_from_cam = Eigen::Quaterniond::FromTwoVectors(extent.middle_in_cam, Eigen::Vector3d::UnitZ());
  const double depth = extent.middle_in_cam.norm();
  for (int j = 0; j < 19; ++j) {
    if (!plausible[j]) continue;
    const Eigen::Vector3d x = crop_from_cam * (camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j)));
    if (x[2] < kMinDepthM) return std::nullopt;
    const double reach = std::max(std::abs(x[0]), std::abs(x[1])) + Thickness(j);
    extent.half_extent_m = std::max(extent.half_extent_m, reach * depth / x[2]);
  }
  return extent;
}

geometry::RigCamera CropCamera(const geometry::RigCamera& camera, const Eigen::Vector3d& middle_in_cam, double half_extent_m,
                               double fill, int size_px) {
  MVS_CHECK(half_extent_m > 0 && fill > 0 && size_px > 0 && middle_in_cam[2] > 0,
            "half_extent_m = " << half_extent_m << ", fill = " << fill << ", size_px = " << size_px
                               << ", depth = " << middle_in_cam[2]);
  geometry::RigCamera crop;
  const double focal_px = fill * (size_px / 2.0) * middle_in_cam.norm() / half_extent_m;
  crop.camera = geometry::MakePinhole(camera.camera.name, size_px, size_px, focal_px);
  const Eigen::Quaterniond crop_from_cam = Eigen::Quaterniond::FromTwoVectors(middle_in_cam, Eigen::Vector3d::UnitZ());
  crop.cam_from_world = geometry::Rigid3{crop_from_cam, Eigen::Vector3d::Zero()} * camera.cam_from_world;
  return crop;
}

geometry::RigCamera ResizedCrop(const geometry::RigCamera& crop, int size_px) {
  const double scale = static_cast<double>(size_px) / crop.camera.width_px;
  geometry::RigCamera resized = crop;
  resized.camera = geometry::MakePinhole(crop.camera.name, size_px, size_px, scale * crop.camera.fx());
  return resized;
}

}  // namespace mvstudio::dataset
