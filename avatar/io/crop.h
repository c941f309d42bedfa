#pragma once

#include <array>
#include <optional>

#include "core/image.h"
#include "dataset/pose3d.h"
#include "geometry/rig.h"

namespace mvstudio::avatar {

/// Where a person is, seen from one camera: the middle of the joints' bounding box, grown by the thickness of the body around
/// them.
struct PersonExtent {
  Eigen::Vector3d middle_in_cam = Eigen::Vector3d::Zero();  ///< metres, in the source camera
  double half_extent_m = 0;  ///< largest distance from the middle along x or y of the crop, at the depth of the middle
};

/// Joints farther than this from the median of all joints are not the person's (wrong triangulation) and do not count.
inline constexpr double kMaxReachM = 1.6;

/// Joints that are valid, finite and within kMaxReachM of the median of the joints.
std::array<bool, 19> PlausibleJoints(const dataset::Coco19Pose& pose);

/// Nothing when no joint is plausible or one is less than 10 cm before the camera.
std::optional<PersonExtent> MeasurePerson(const dataset::Coco19Pose& pose, const geometry::RigCamera& camera);

/// A pinhole camera of size_px x size_px at the place of `camera`, turned by the smallest rotation that brings `middle_in_cam`
/// onto the optical axis; `half_extent_m` metres at that depth reach `fill` of the way from the centre to the edge.
geometry::RigCamera CropCamera(const geometry::RigCamera& camera, const Eigen::Vector3d& middle_in_cam, double half_extent_m,
                               double fill, int size_px);

/// What `to` sees, looked up in a picture of `from`; both stand at the same place. Each pixel is the mean of bilinear samples
/// on a regular grid over its footprint, dense enough to skip no source pixel. Outside the source picture: 0.
Image Resample(const Image& source, const geometry::RigCamera& from, const geometry::RigCamera& to);

}  // namespace mvstudio::avatar
