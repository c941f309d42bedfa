#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/pose/pose3d.h"

namespace mvstudio::dataset {

/// Distances of joints from those of a reference, mm.
struct Pose3dComparison {
  int num = 0;  ///< joints compared; the figures are 0 when there are none
  double median_mm = 0, mean_mm = 0, p95_mm = 0, max_mm = 0;
  int persons_left_out = 0;  ///< not in the reference: in most of their frames, others were nearer to all that it has
  bool aligned = false;      ///< after the best rigid motion onto the reference
  int num_covariance = 0;    ///< joints that had a covariance
  double coverage68 = 0;     ///< fraction of these inside the ellipsoid of 68 % probability
  double coverage95 = 0;
  std::string why_none;                          ///< where `num` is 0: what of the two does not match, in a sentence
  std::vector<std::string> without_counterpart;  ///< names of the reference's joints that the pose does not have
};

/// frame -> person -> joint of a pose, Ok ones only.
using JointTable = std::map<int, std::map<int, std::map<std::string, JointRow>>>;

JointTable ToTable(const std::vector<JointRow>& rows);

/// The Panoptic joints as a table by OpenPose's names, with covariances where all sources have one.
JointTable ToCoco19Table(const Pose3d& pose);
JointTable ToTable(const std::map<int, std::map<int, Coco19Pose>>& poses);

/// Compares joints of the same frame and name. Names are equal for all spellings of one joint (geometry::JointKey), unless a
/// name is there itself; of labels "SUBJECT:MARKER", on either side, the subjects are persons. In a frame each person of the
/// reference is compared with one person, nearest pairs first. A person for whom nobody was left in most of the frames is not
/// in the reference and is left out. `align`: removes the best rigid motion (no scale) first.
Pose3dComparison ComparePose3d(const JointTable& pose, const JointTable& reference, bool align = false);

}  // namespace mvstudio::dataset
