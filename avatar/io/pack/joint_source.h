#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "dataset/panoptic/panoptic.h"

namespace mvstudio::avatar {

/// One person's joints in one of the lists of avatar/maps/bone_lists.h.
struct FullPose {
  Eigen::Matrix3Xd x_in_world;  ///< metres
  std::vector<bool> valid;
};

/// What 19 joints tell of a list of `num_joints`: the body, without toes, heels, hands and face. Joints that are not plausible
/// (dataset/views/crop.h) are not there.
FullPose BodyAlone(const dataset::Coco19Pose& pose, int num_joints);

/// The joints that a dataset has beyond Panoptic's 19.
class JointSource {
 public:
  /// Reads, for `frames`, the sequence's face70 and hand files (CMU's hdFace3d, hdHand3d), and `pose3d`, a folder with
  /// points.csv (triangulated key points with toes, hands or a face; skeletons of OpenPose's names), which comes first where it
  /// has a joint. Nothing is read that a list of `num_joints` has no place for. Throws IoError, FormatError.
  JointSource(const dataset::PanopticDataset& data, int person, int num_joints, const std::string& pose3d,
              const std::vector<int>& frames);

  /// BodyAlone with what else is known of that frame. Points of a face or hand more than 35 cm from nose or wrist, and those of
  /// CMU's whose score is 0.05 or less, are left out.
  FullPose At(int frame, const dataset::Coco19Pose& pose) const;
  int num_joints() const { return num_joints_; }
  /// Frames with at least one joint of hands, face, toes or heels.
  int num_extended() const { return static_cast<int>(found_.size()); }

 private:
  struct Found {
    std::map<int, Eigen::Vector3d> x_in_world;  // by index in the list
  };
  void ReadLandmarks(const dataset::PanopticDataset& data, int person, const std::vector<int>& frames);
  void ReadTable(const std::string& folder, int person);

  int num_joints_;
  std::map<int, Found> found_;
};

}  // namespace mvstudio::avatar
