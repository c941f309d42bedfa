#pragma once

#include <map>
#include <optional>
#include <string>

#include "dataset/pose/pose3d.h"
#include "geometry/skeleton/skeleton.h"

/// Joints of any skeleton beside Panoptic's 19, in a folder of their own: hdPose3d_stage1_NAME holds skeleton.json (the keys of
/// a skeleton's file) and body3DScene_%08d.json with `jointsN`: x, y, z (centimetres, y down), confidence of its N joints.
namespace mvstudio::dataset {

struct OwnJoints {
  geometry::Skeleton skeleton;
  std::map<int, std::map<int, JointsPose>> poses;  ///< frame -> person -> joints, in our world
  std::map<int, std::string> files;                ///< frame -> path, of joints that were read
};

/// "hdPose3d_stage1_mouse".
std::string OwnJointsFolder(const std::string& skeleton);

/// The folder of a dataset that holds such joints; empty: there is none. Throws FormatError for more than one.
std::string FindOwnJoints(const std::string& root);

/// Writes the folder below `root`. Joints that are not valid are (0, 0, 0, -1).
void WriteOwnJoints(const OwnJoints& joints, double frame_rate_hz, const std::string& root);

/// The people of one file. Throws IoError, FormatError (path, place).
std::map<int, JointsPose> ReadOwnScene(const std::string& path, const geometry::Skeleton& skeleton);
/// The skeleton that a folder states, and its files without their content.
OwnJoints ListOwnJoints(const std::string& folder);
/// All of them; none where there is no such folder. Throws IoError, FormatError.
std::optional<OwnJoints> ReadOwnJoints(const std::string& root);

}  // namespace mvstudio::dataset
