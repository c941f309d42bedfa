#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/progress.h"
#include "triangulate/prepared_rig.h"

namespace mvstudio::triangulate {

/// One detected joint in one image; score 0 means not detected.
struct Keypoint {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double score = 0;
};

using DetectedPerson = std::vector<Keypoint>;  // (num_joints)

/// Everything the cameras saw at one instant.
struct DetectedFrame {
  int frame = 0;
  std::vector<std::vector<DetectedPerson>> people;  // [camera][person in the image]; cameras in the rig's order
};

struct AssociationOptions {
  double max_error_px = 0;  ///< two views of a person agree up to this median distance; 0: 1.5 % of the image diagonal
  double min_score = 0.3;   ///< joints below do not take part
  int min_joints = 3;       ///< common joints that two views of a person need
  int max_persons = 1;      ///< the best supported so many people of the take are kept
  double max_step_m = 0.5;  ///< farthest a person's joints move, on average, from one frame to the next
  int max_gap_frames = 30;  ///< a person unseen for longer starts a new track
};

/// One person in one frame.
struct Cluster {
  std::vector<int> choice;                             // [camera]: index into DetectedFrame::people[camera], or -1
  std::vector<std::optional<Eigen::Vector3d>> joints;  // [joint]: rough position in local, metres
  int support = 0;                                     // joints seen, summed over the cameras that agree
};

/// Groups the people of one frame across cameras: every pair of detections proposes a skeleton, the one that most cameras agree
/// with (each with at most one person) is taken and its detections removed, and so on. People that only one camera sees form no
/// cluster.
std::vector<Cluster> AssociateFrame(const PreparedRig& rig, const DetectedFrame& frame, const AssociationOptions& options);

/// [frame][person][camera]: which detection shows the person, or -1. Persons are numbered by how well they are supported over
/// the take and keep their number across frames. Where no image holds more than one person there is nothing to choose.
std::vector<std::vector<std::vector<int>>> AssociateTake(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                                         const AssociationOptions& options, const RunContext& run);

}  // namespace mvstudio::triangulate
