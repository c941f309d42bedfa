#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

namespace mvstudio::dataset {

/// A Biovision hierarchy and its motion, in the file's own axes and unit.
struct BvhClip {
  struct Joint {
    std::string name;
    int parent = -1;  ///< parents come first
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();
    std::vector<std::string> channels;  ///< "Xposition", "Zrotation", …, as they stand
  };
  std::vector<Joint> joints;  ///< without end sites
  double frame_time_s = 0;
  int num_frames = 0, num_channels = 0;
  std::vector<double> values;  ///< (num_frames, num_channels), degrees and the file's unit
};

/// Throws IoError, or FormatError with the line. At most 1024 joints and 2^28 values.
BvhClip ReadBvh(const std::string& path);
BvhClip BvhFromText(const std::string& text, const std::string& path_for_messages);

/// Position and orientation of each joint: x_in_file = rotation x_in_joint + place. `frame` -1: the rest pose.
struct BvhPlacement {
  std::vector<Eigen::Vector3d> place;
  std::vector<Eigen::Matrix3d> rotation;
};
BvhPlacement PlaceJoints(const BvhClip& clip, int frame);

}  // namespace mvstudio::dataset
