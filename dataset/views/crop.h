#pragma once

#include <array>
#include <memory>
#include <optional>

#include "core/image.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

namespace mvstudio::dataset {

/// Position of a person seen from one camera: the middle of the joints' bounding box, enlarged by the thickness of the
/// body.
struct PersonExtent {
  Eigen::Vector3d middle_in_cam = Eigen::Vector3d::Zero();  ///< metres, in the source camera
  double half_extent_m = 0;  ///< largest distance from the middle along x or y of the crop, at the depth of the middle
};

/// Joints farther than this from the median of all joints are taken as wrong triangulations and ignored.
inline constexpr double kMaxReachM = 1.6;

/// Joints that are valid, finite and within kMaxReachM of the median of the joints.
std::array<bool, 19> PlausibleJoints(const Coco19Pose& pose);

/// Empty when no joint is plausible or one is less than 10 cm before the camera.
std::optional<PersonExtent> MeasurePerson(const Coco19Pose& pose, const geometry::RigCamera& camera);

/// A pinhole camera of size_px x size_px at the position of `camera`, with the smallest rotation that brings
/// `middle_in_cam` onto the optical axis. `half_extent_m` metres at that depth extend to `fill` of the way from the centre
/// to the edge.
geometry::RigCamera CropCamera(const geometry::RigCamera& camera, const Eigen::Vector3d& middle_in_cam, double half_extent_m,
                               double fill, int size_px);

/// The same view of a crop's camera with another number of pixels.
geometry::RigCamera ResizedCrop(const geometry::RigCamera& crop, int size_px);

/// Treatment of pixels without a source in the mean over a footprint.
enum class Border {
  kBlack,  ///< they count as 0
  kLeave,  ///< the mean is over the others; 0 where there are none
};

/// Map from images of `from` to images of `to` at the same position, computed once; both may have any lens. Each pixel is
/// the mean of bilinear samples on a regular grid over its footprint, dense enough to skip no source pixel. Source
/// positions come from the exact lens on a grid of knots. Between the knots they are interpolated cubically where that is
/// accurate to 1/1000 px of the coarser image.
class ResampleMap {
 public:
  ResampleMap(const geometry::RigCamera& from, const geometry::RigCamera& to);

  Image Apply(const Image& source, Border border = Border::kBlack, int num_threads = 1) const;
  /// 255 where at least half of the footprint is foreground (a value of 128 or more counts by its share), else 0.
  Image Mask(const Image& source, int num_threads = 1) const;
  /// 255 where at least half of the footprint lies in the source image, else 0.
  Image Validity() const;

  /// Position of a pixel of `to` in the image of `from`, by the exact lens; NaN where `from` cannot see it.
  Eigen::Vector2d SourceOf(const Eigen::Vector2d& px) const;
  /// Same by the interpolated knots, as images are resampled.
  Eigen::Vector2d SampledSourceOf(const Eigen::Vector2d& px) const;
  int samples_per_side() const;

 private:
  struct Knots;
  std::shared_ptr<const Knots> knots_;
};

/// ResampleMap for one image: the view of `to`, looked up in an image of `from`. Outside the source image: 0.
Image Resample(const Image& source, const geometry::RigCamera& from, const geometry::RigCamera& to);

}  // namespace mvstudio::dataset
