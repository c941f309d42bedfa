#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dataset/time/timeline.h"
#include "stages/input/pose_input.h"
#include "stages/result.h"
#include "triangulate/take/take.h"

/// 3D joints projected into an image of each camera beside its keypoints, for the report.
namespace mvstudio::stages {

/// In a take's output folder, owned by mvstudio.
inline constexpr char kJointViewsFolder[] = "joint-views";

/// Where the images of a take lie. A time step without a frame in the timeline has none; without timeline the numbers agree.
struct TakeImages {
  std::vector<NamedPath> cameras;
  std::shared_ptr<const dataset::Timeline> timeline;
};

/// One camera at one time step.
struct JointView {
  int camera_idx = 0;
  int time_step = 0;
  int64_t frame = -1;  ///< as in the footage; -1: no image is to be had
  /// Of all persons one after the other, joint by joint: px, NaN where there is none.
  std::vector<Eigen::Vector2d> projected_px, keypoint_px;
};

/// The same time step for all cameras where possible: among those with at least nine tenths of the most keypoints with a 3D
/// joint the one of median reprojection error; cameras that see nobody then have their own. `rig` is what solved the take.
std::vector<JointView> ChooseJointViews(const geometry::Rig& rig, const triangulate::TakeResult& take, int num_joints,
                                        const TakeImages& images);

/// A view with the part of the camera's image around its points.
struct ShownView {
  JointView view;
  std::string camera;
  int x = 0, y = 0, width = 0, height = 0;  ///< the part, px
  std::string image = {};                   ///< path; empty: there is no image
};

struct JointViewReport {
  std::vector<ShownView> views;
  std::vector<std::pair<int, int>> bones;
  size_t num_joints = 0;
};

/// Writes small images of the views into the folder kJointViewsFolder of `out`, in place of an earlier run's.
JointViewReport WriteJointViews(const geometry::Rig& rig, const triangulate::TakeResult& take,
                                const geometry::Skeleton& skeleton, const TakeImages& images, const std::string& out);

/// "overlays" in the metrics: {bones, num_joints, views: [{camera, instant, frame, median_px, max_px, num_points, box_px,
/// picture, joints}]}; a joint is [x, y of the projection, x, y of the keypoint] px. The images are outputs.
CommandResult DescribeJointViews(const JointViewReport& report);

}  // namespace mvstudio::stages
