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

/// The body joints of a list of `num_joints` from 19 joints, without toes, heels, hands and face. Joints that are not
/// plausible (dataset/views/crop.h) are missing.
FullPose BodyAlone(const dataset::Coco19Pose& pose, int num_joints);

/// The joints that a dataset has beyond Panoptic's 19.
class JointSource {
 public:
  /// Reads, for `frames`, the sequence's face70 and hand files (CMU's hdFace3d, hdHand3d), and `pose3d`, a folder with
  /// points.csv (triangulated keypoints with toes, hands or a face; skeletons of OpenPose's names), which takes
  /// precedence. Reads only joints that a list of `num_joints` contains. Throws IoError, FormatError.
  JointSource(const dataset::PanopticDataset& data, int person, int num_joints, const std::string& pose3d,
              const std::vector<int>& frames);

  /// BodyAlone with the other known joints of that frame. Points of a face or hand more than 35 cm from nose or wrist, and
  /// those of CMU's with a score of 0.05 or less, are left out.
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
