#pragma once

#include <string>
#include <vector>

#include "calib/view.h"
#include "core/status.h"

namespace mvstudio::calib {

struct RigStart {
  Status status = Status::kOk;  ///< kDegenerate when the cameras fall into several groups; kTooFewViews without views
  std::string message;          ///< names the groups and the missing link
  std::vector<std::vector<int>> components;  ///< camera indices that are linked by boards seen together, largest group first
};

/// Cameras and boards in one frame, from the pose of each board in each camera. Cameras are chained from `reference` (whose
/// cam_from_world becomes the identity) along the maximum spanning tree of shared corners; each link is the relative pose that
/// agrees best with the other shared frames. `cam_from_board[v]` belongs to views[v]; views without any weight are not used.
/// Fills cam_from_world and world_from_board of `state`.
RigStart InitializeRig(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board, int reference,
                       RigState* state);

}  // namespace mvstudio::calib
