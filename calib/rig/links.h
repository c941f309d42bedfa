#pragma once

#include <vector>

#include "calib/bundle/view.h"
#include "calib/rig/rotation_averaging.h"

namespace mvstudio::calib {

/// A view with the pose of its board, as the start of a rig uses it.
struct Sight {
  int camera = 0, frame = 0, board = 0;
  int corners = 0;  ///< with a weight
  const View* view = nullptr;
  geometry::Rigid3 cam_from_board;
  Eigen::Matrix3d marks_in_board;  ///< middle of the corners and two points beside it, a typical corner's distance away
  double depth = 1;                ///< metres from the camera to the middle
};

/// Sights of one frame.
using FrameSights = std::vector<Sight>;

/// Nodes whose poses relative to each other are known within groups; the pose of a node is node_from_group.
struct PosedGroups {
  std::vector<std::vector<int>> groups;
  std::vector<int> group_of;  // per node
  std::vector<geometry::Rigid3> poses;

  bool Linked(int a, int b) const { return group_of[a] == group_of[b]; }
};

/// Every node a group of its own.
PosedGroups SingleNodes(int num_nodes);

/// Groups that the links make, posed by all links at once or along the spanning tree.
PosedGroups PoseByLinks(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known, bool averaged);

/// Usable views, frame after frame; within one by camera and board. `rank[camera_idx]` numbers the cameras.
std::vector<FrameSights> CollectSights(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board,
                                       const std::vector<int>& rank);

/// Links of cameras that see one board, or boards of one group, in the same frames: the relative pose on which most of the
/// shared frames agree, fitted to where it puts the boards. Its weight is the number of shared corners that agree.
std::vector<PoseLink> LinkCameras(const std::vector<FrameSights>& frames, const PosedGroups& boards);

/// Likewise of boards that one camera sees, or cameras of one group, in the same frames.
std::vector<PoseLink> LinkBoards(const std::vector<FrameSights>& frames, const PosedGroups& cameras);

/// How far a pose of a board moves its marks from where the sight has them, relative to their distance.
double MarksMoved(const Sight& sight, const geometry::Rigid3& cam_from_board);

}  // namespace mvstudio::calib
