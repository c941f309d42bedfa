#pragma once

#include <vector>

#include "calib/bundle/view.h"
#include "calib/rig/rotation_averaging.h"

namespace mvstudio::calib {

/// A view with the pose of its board, for the initialization of a rig.
struct PosedView {
  int camera = 0, frame = 0, board = 0;
  int corners = 0;  ///< with a weight
  const View* view = nullptr;
  geometry::Rigid3 cam_from_board;
  Eigen::Matrix3d marks_in_board;  ///< centre of the corners and two points beside it, at a typical corner's distance
  double depth = 1;                ///< metres from the camera to the centre
};

/// Posed views of one frame.
using PosedViews = std::vector<PosedView>;

/// Nodes grouped by known relative poses; the pose of a node is node_from_group.
struct PosedGroups {
  std::vector<std::vector<int>> groups;
  std::vector<int> group_of;  // per node
  std::vector<geometry::Rigid3> poses;

  bool Linked(int a, int b) const { return group_of[a] == group_of[b]; }
};

/// Every node a group of its own.
PosedGroups SingleNodes(int num_nodes);

/// Groups that the links connect, posed by all links at once (`averaged`) or along the spanning tree.
PosedGroups PoseByLinks(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known, bool averaged);

/// Usable views by frame, then by camera and board. `rank[camera_idx]` orders the cameras.
std::vector<PosedViews> CollectPosedViews(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board,
                                          const std::vector<int>& rank);

/// Links between cameras that see one board, or boards of one group, in the same frames. The relative pose is the one that
/// most shared frames agree on, fitted to the board positions. Its weight is the number of shared corners that agree.
std::vector<PoseLink> LinkCameras(const std::vector<PosedViews>& frames, const PosedGroups& boards);

/// Same for boards that one camera, or cameras of one group, see in the same frames.
std::vector<PoseLink> LinkBoards(const std::vector<PosedViews>& frames, const PosedGroups& cameras);

/// Displacement of a board's marks by a pose, against the view's own, relative to their distance.
double MarksMoved(const PosedView& observation, const geometry::Rigid3& cam_from_board);

}  // namespace mvstudio::calib
