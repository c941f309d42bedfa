#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "core/progress.h"
#include "triangulate/point/prepared_rig.h"

namespace mvstudio::triangulate {

/// One detected joint in one image; score 0 means not detected.
struct Keypoint {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double score = 0;
};

using DetectedPerson = std::vector<Keypoint>;  // (num_joints)

/// All detections of the cameras at one time step.
struct DetectedFrame {
  int frame = 0;
  std::vector<std::vector<DetectedPerson>> people;  // [camera][person in the image]; cameras in the rig's order
};

struct AssociationOptions {
  double max_error_px = 0;  ///< upper bound on a joint's error in a view: limit of 3 sigma_px; 0: 1.5 % of the image diagonal
  double min_score = 0.3;   ///< joints below are ignored
  int min_joints = 3;       ///< minimum number of common joints of two views of a person
  int max_persons = 1;      ///< maximum number of people kept per take, the best supported ones
  double max_step_m = 0.5;  ///< largest mean displacement of a person's joints between consecutive frames
  int max_gap_frames = 30;  ///< a person unseen for longer starts a new track
  double sigma_px = 0;      ///< noise of a joint, calibration errors included; 0: estimated from the frames
  std::vector<std::pair<int, int>> mirror = {};  ///< (left, right) joints; a detection that fits nobody may fit mirrored
};

/// One person in one frame.
struct Cluster {
  std::vector<int> choice;                             // [camera]: index into DetectedFrame::people[camera], or -1
  std::vector<std::optional<Eigen::Vector3d>> joints;  // [joint]: rough position in local, metres
  int support = 0;                                     // joints seen, summed over the cameras that agree
};

/// Groups the people of one frame across cameras; the best supported cluster first.
///
/// Two detections agree if the rays of their common joints pass each other within their noise: every joint adds between +1
/// (no distance), 0 (3 sigma) and -1. The groups with the largest sums between them are joined, with at most one detection
/// per camera (greedy additive edge contraction: Keuper et al., "Efficient decomposition of image and mesh graphs by
/// lifted multicuts", ICCV 2015).
///
/// Then each camera in turn is removed, and its detections are reassigned, all at once and optimally (assignment.h), to
/// the points that the others determine, until nothing changes. This removes matches that are consistent in pairs only
/// (epipolar planes through several people), as does the cycle consistency of Dong et al., "Fast and robust multi-person
/// 3D pose estimation from multiple views", CVPR 2019.
///
/// With `mirror`, unassigned detections are compared with the clusters again with left and right exchanged (FixSides in
/// sides.h then finds them); they do not contribute to the clusters' joints. People that only one camera sees form no
/// cluster.
std::vector<Cluster> AssociateFrame(const PreparedRig& rig, const DetectedFrame& frame, const AssociationOptions& options);

/// Identities in a take.
struct TakeAssociation {
  /// [frame][person][camera]: which detection shows the person, or -1.
  std::vector<std::vector<std::vector<int>>> assignment;
  double sigma_px = 0;       ///< noise assumed by the association; 0 where no choice was needed
  int num_ghosts = 0;        ///< number of removed chains of chance matches
  int num_ghost_frames = 0;  ///< number of clusters in them
};

/// Persons are numbered by their support over the take and keep their number across frames (tracks.h). If no image holds
/// more than one person, no choice is needed. The result does not depend on the number of threads.
TakeAssociation AssociatePeople(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                const AssociationOptions& options, const RunContext& run);

/// The assignment alone.
std::vector<std::vector<std::vector<int>>> AssociateTake(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                                         const AssociationOptions& options, const RunContext& run);

}  // namespace mvstudio::triangulate
