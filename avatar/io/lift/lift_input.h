#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "body/skeleton.h"
#include "core/status.h"
#include "dataset/pose/pose2d.h"
#include "geometry/lens/camera.h"

namespace mvstudio::avatar {

inline constexpr int kLiftJoints = 19;  ///< CMU Panoptic's
inline constexpr int kLiftWindow = 5;   ///< frames that are lifted together
inline constexpr int kMinLiftJoints = 6;

/// What one camera saw of a person in one frame: directions, so that no lens is left in them.
struct LiftView {
  Eigen::Matrix<double, 3, kLiftJoints> ray_in_cam = Eigen::Matrix<double, 3, kLiftJoints>::Zero();  ///< any length
  std::array<double, kLiftJoints> score{};                                                           ///< 0..1; 0: not seen
};

/// The Panoptic joints of a detection through the camera's exact lens. A joint that is the mean of two needs both; pixels that
/// the lens cannot have produced count as not seen; NaN stays, to be refused by MakeLiftInput.
LiftView ViewOf(const geometry::Projector& projector, const dataset::Person2d& person, const body::Skeleton& skeleton);

struct LiftInput {
  Status status = Status::kOk;
  std::vector<float> values;                         ///< kLiftInputs of avatar/lift/lift.h
  Eigen::Matrix3d cam_from_view;                     ///< the level, person-centred view that the network's answer is in
  Eigen::Matrix<double, 2, kLiftJoints> xy_in_view;  ///< middle frame, in the plane z = 1 of the view
  std::array<double, kLiftJoints> score{};
};

/// What the lifting network sees of five neighbouring frames; frames that are missing have no joints.
///
/// The camera is turned to look at the middle of the person and, when the direction of `up_in_cam` (any length) is known,
/// levelled: neither the lens nor the place in the picture nor the camera's roll is left, only the pitch, which is an input of
/// its own. Coordinates are centred and divided by the spread of all seen joints of the five frames. Status: kNonFiniteInput,
/// kTooFewViews below 6 joints in the middle frame, kBehindCamera when their directions point away from the view, kDegenerate
/// when they all coincide.
LiftInput MakeLiftInput(const std::array<LiftView, kLiftWindow>& window, const std::optional<Eigen::Vector3d>& up_in_cam);

struct LiftPlacement {
  Status status = Status::kOk;
  Eigen::Vector3d root_in_view = Eigen::Vector3d::Zero();  ///< metres
  double rms = 0;                                          ///< of the residuals in the plane z = 1
};

/// Where the lifted joints (3, 19; metres, relative to the root, axes of the view) must stand to be seen at `xy`: the t that
/// minimises sum score |(x + t)_xy - (x + t)_z xy|^2, in closed form. One camera does not show size: the distance is
/// proportional to the size of the joints. Status: kNonFiniteInput, kTooFewViews below 6 joints, kDegenerate when the joints
/// coincide in the picture, kBehindCamera when the best place is not in front.
LiftPlacement PlaceInView(const Eigen::Matrix<double, 3, kLiftJoints>& x, const Eigen::Matrix<double, 2, kLiftJoints>& xy,
                          const std::array<double, kLiftJoints>& score);

}  // namespace mvstudio::avatar
