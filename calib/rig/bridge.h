#pragma once

#include <string>
#include <vector>

#include "calib/rig/links.h"

namespace mvstudio::calib {

/// Two groups of cameras that see different boards in the same frames, and why these frames do not link them.
struct RefusedBridge {
  int group_a = 0, group_b = 0;  ///< of cameras
  int frames = 0;                ///< frames that both groups have
  std::string reason;
};

struct Bridges {
  std::vector<PoseLink> cameras, boards;  ///< between the first nodes of the groups they link
  std::vector<RefusedBridge> refused;
};

/// Links between groups of cameras that never share a board, from the motion of the boards they see in the same frames
/// (SolveHandEye). Takes the most certain links that connect every group at most once.
Bridges FindBridges(const std::vector<PosedViews>& frames, const PosedGroups& cameras, const PosedGroups& boards);

}  // namespace mvstudio::calib
