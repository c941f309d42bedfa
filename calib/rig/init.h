#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/bundle/view.h"
#include "core/status.h"

namespace mvstudio::calib {

struct RigInitOptions {
  /// Per camera (empty: none): given poses. If there is any, these define the world and the reference is not used.
  std::vector<std::optional<geometry::Rigid3>> known_cam_from_world;
};

/// Where two groups of cameras come closest to seeing boards at the same time step.
struct NearMiss {
  int camera_a = 0, camera_b = 0;
  int64_t frame_a = 0, frame_b = 0;  ///< frame_idx
};

struct RigStart {
  Status status = Status::kOk;  ///< kDegenerate when the cameras fall into several groups; kTooFewViews without views
  std::string message;          ///< one line: the groups, the missing link and how close it is
  std::vector<std::vector<int>> components;  ///< camera indices that are linked, largest group first
  std::vector<int> component_frames;         ///< per component: frames in which it saw a board
  std::optional<NearMiss> near_miss;         ///< of the first component and another; with kDegenerate
  /// Boards with linked positions, by group, first board first; boards nobody saw are in none. The first board of a group
  /// has the identity as rig_from_board. Boards of different groups are never seen in one frame.
  std::vector<std::vector<int>> board_components;
  bool averaged = false;  ///< the poses come from all links at once and not from a spanning tree
  double median_px = 0;   ///< median distance of a corner from where the start puts it
};

/// Initial poses of cameras and boards from the pose of each board in each camera. `cam_from_board[v]` belongs to
/// views[v]; views with fewer than 4 weighted corners or a non-finite pose are not used.
///
/// Two cameras that see one board at the same time are linked, and so are two boards that one camera sees. The groups
/// found that way are linked again by what they see together, until nothing changes. Groups that never share a board are
/// linked by the motion of the boards they see in the same frames (SolveHandEye).
///
/// The poses come from the maximum spanning tree of shared corners or from the average over all links (AverageRotations,
/// AverageTranslations), whichever explains the corners better. Each frame's boards are placed where the cameras that see
/// them agree best.
///
/// cam_from_world of `reference` becomes the identity unless poses are given. Fills cam_from_world, rig_from_board and
/// world_from_board of `state`, whose cameras and frames must be set. The result does not depend on the order of the
/// cameras and views.
RigStart InitializeRig(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board, int reference,
                       RigState* state, const RigInitOptions& options = {});

}  // namespace mvstudio::calib
