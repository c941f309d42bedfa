#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "core/status.h"
#include "dataset/pose/pose2d.h"
#include "geometry/lens/camera.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::avatar {

inline constexpr int kLiftJoints = 19;  ///< CMU Panoptic's
inline constexpr int kLiftWindow = 5;   ///< frames that are lifted together
inline constexpr int kMinLiftJoints = 6;

/// A camera's observation of a person in one frame, as directions, so that it is independent of the lens.
struct LiftView {
  Eigen::Matrix<double, 3, kLiftJoints> ray_in_cam = Eigen::Matrix<double, 3, kLiftJoints>::Zero();  ///< any length
  std::array<double, kLiftJoints> score{};                                                           ///< 0..1; 0: not seen
};

/// The Panoptic joints of a detection through the camera's exact lens. A joint that is the mean of two needs both; pixels
/// that the lens cannot have produced count as not seen; NaN is kept, to be rejected by MakeLiftInput.
LiftView ViewOf(const geometry::Projector& projector, const dataset::Person2d& person, const geometry::Skeleton& skeleton);

struct LiftInput {
  Status status = Status::kOk;
  std::vector<float> values;                         ///< kLiftInputs of avatar/lift/lift.h
  Eigen::Matrix3d cam_from_view;                     ///< the level, person-centred view of the network's output
  Eigen::Matrix<double, 2, kLiftJoints> xy_in_view;  ///< middle frame, in the plane z = 1 of the view
  std::array<double, kLiftJoints> score{};
};

/// Network input for five neighbouring frames; missing frames have no joints.
///
/// The camera is rotated to look at the middle of the person and, when the direction of `up_in_cam` (any length) is known,
/// levelled. This removes the lens, the position in the image and the camera's roll; the pitch remains as a separate
/// input. Coordinates are centred and divided by the spread of all seen joints of the five frames.
///
/// Status: kNonFiniteInput, kTooFewViews below 6 joints in the middle frame, kBehindCamera when their directions point
/// away from the view, kDegenerate when they all coincide.
LiftInput MakeLiftInput(const std::array<LiftView, kLiftWindow>& window, const std::optional<Eigen::Vector3d>& up_in_cam);

struct LiftPlacement {
  Status status = Status::kOk;
  Eigen::Vector3d root_in_view = Eigen::Vector3d::Zero();  ///< metres
  double rms = 0;                                          ///< of the residuals in the plane z = 1
};

/// Position at which the lifted joints (3, 19; metres, relative to the root, axes of the view) project to `xy`: the t that
/// minimises sum score |(x + t)_xy - (x + t)_z xy|^2, in closed form. One camera cannot measure size: the distance is
/// proportional to the size of the joints. Status: kNonFiniteInput, kTooFewViews below 6 joints, kDegenerate when the
/// joints coincide in the image, kBehindCamera when the best position is not in front.
LiftPlacement PlaceInView(const Eigen::Matrix<double, 3, kLiftJoints>& x, const Eigen::Matrix<double, 2, kLiftJoints>& xy,
                          const std::array<double, kLiftJoints>& score);

}  // namespace mvstudio::avatar
