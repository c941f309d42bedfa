#pragma once

#include <array>
#include <memory>
#include <optional>

#include "core/image.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

namespace mvstudio::dataset {

/// Where a person is, seen from one camera: the middle of the joints' bounding box, grown by the thickness of the body around
/// them.
struct PersonExtent {
  Eigen::Vector3d middle_in_cam = Eigen::Vector3d::Zero();  ///< metres, in the source camera
  double half_extent_m = 0;  ///< largest distance from the middle along x or y of the crop, at the depth of the middle
};

/// Joints farther than this from the median of all joints are not the person's (wrong triangulation) and do not count.
inline constexpr double kMaxReachM = 1.6;

/// Joints that are valid, finite and within kMaxReachM of the median of the joints.
std::array<bool, 19> PlausibleJoints(const Coco19Pose& pose);

/// Nothing when no joint is plausible or one is less than 10 cm before the camera.
std::optional<PersonExtent> MeasurePerson(const Coco19Pose& pose, const geometry::RigCamera& camera);

/// A pinhole camera of size_px x size_px at the place of `camera`, turned by the smallest rotation that brings `middle_in_cam`
/// onto the optical axis; `half_extent_m` metres at that depth reach `fill` of the way from the centre to the edge.
geometry::RigCamera CropCamera(const geometry::RigCamera& camera, const Eigen::Vector3d& middle_in_cam, double half_extent_m,
                               double fill, int size_px);

/// The same view of a crop's camera in another number of pixels.
geometry::RigCamera ResizedCrop(const geometry::RigCamera& crop, int size_px);

/// What pixels without a source do to the mean over a pixel's footprint.
enum class Border {
  kBlack,  ///< they count as 0
  kLeave,  ///< the mean is over the rest; 0 where there is no rest
};

/// How the pictures of `from` turn into those of `to` at the same place, worked out once for all of them; both may have any
/// lens. Each pixel is the mean of bilinear samples on a regular grid over its footprint, dense enough to skip no source pixel.
/// Places in the source come from the exact lens on a grid of knots, with cubic interpolation between them where that is within
/// 1/1000 px of the coarser of the two pictures.
class ResampleMap {
 public:
  ResampleMap(const geometry::RigCamera& from, const geometry::RigCamera& to);

  Image Picture(const Image& source, Border border = Border::kBlack, int num_threads = 1) const;
  /// 255 where at least half of the footprint is foreground (a value of 128 or more counts by its share), else 0.
  Image Mask(const Image& source, int num_threads = 1) const;
  /// 255 where at least half of the footprint lies in the source picture, else 0.
  Image Validity() const;

  /// Where a pixel of `to` lies in the picture of `from`, by the exact lens; NaN where `from` cannot see it.
  Eigen::Vector2d SourceOf(const Eigen::Vector2d& px) const;
  /// The same by the knots, as pictures are resampled.
  Eigen::Vector2d SampledSourceOf(const Eigen::Vector2d& px) const;
  int samples_per_side() const;

 private:
  struct Knots;
  std::shared_ptr<const Knots> knots_;
};

/// ResampleMap for one picture: what `to` sees, looked up in a picture of `from`. Outside the source picture: 0.
Image Resample(const Image& source, const geometry::RigCamera& from, const geometry::RigCamera& to);

}  // namespace mvstudio::dataset
