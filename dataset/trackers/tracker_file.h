#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dataset/pose/pose2d.h"

/// 2D points that other programs tracked: DeepLabCut, SLEAP, caliscope. Pixels are theirs unchanged: all of them put (0, 0)
/// at the centre of the top-left pixel, as mvstudio does.
namespace mvstudio::dataset {

/// One camera's file.
struct TrackedPoints {
  std::string program;                   ///< "DeepLabCut", "SLEAP"
  std::vector<std::string> joints;       ///< body parts, nodes; by order of first appearance
  std::vector<std::string> individuals;  ///< individuals, tracks; empty names where the file has one unnamed animal
  std::vector<std::pair<std::string, std::string>> bones = {};  ///< SLEAP's edges, by joints' names
  /// People in the order of `individuals`, those without any point in that frame left out; keypoints in the order of
  /// `joints`. Scores are the file's likelihoods, 1 where it has none. Frames count as in the file.
  Pose2dTrack track;
  double time_step = 0;  ///< frames were numbered by the rows' times, one in so many of their unit; 0: the file numbers them
};

/// A program's layout; the table of them stands in tracker_file.cc.
struct TrackerFormat {
  std::string_view name;
  bool (*fits)(std::string_view head);  ///< by the first line of text, or the first bytes of HDF5
  TrackedPoints (*read)(const std::string& path, const std::string& camera);  ///< null: a table of all cameras
};

/// By the first bytes of the file; null: none of these, e.g. JSON. Throws IoError; FormatError for what has to be converted
/// first (.pickle, columns of several cameras), with how.
const TrackerFormat* FindTrackerFormat(const std::string& path);

/// Reads one camera's file of any such format. Rows of text that cannot be read are left out and listed; more than half of them
/// are an error. HDF5 files are read in a child process first, because the library may crash on damaged ones. Throws IoError,
/// or FormatError with the place and what to do; so for SLEAP projects (.slp), tables of 3D points and labelled images in HDF5.
TrackedPoints ReadTrackerFile(const std::string& path, const std::string& camera);

/// Same for HDF5 without the child process.
TrackedPoints ReadTrackerHdf5(const std::string& path, const std::string& camera);

/// 2D joints of all cameras in a .npz: an array cameras x frames (x people) x joints x 2 or 3 (x, y, score), the names
/// `cameras` and, where they are there, `joint_names`; without, 33 joints are MediaPipe's and others are called point_0, …. Of
/// one camera (ReadTrackerFile) the first axis is left out, and a .npy is enough. NaN, and (0, 0) without scores, are not
/// detected. Throws FormatError with the shape and what is missing.
std::vector<TrackedPoints> ReadPointArrays(const std::string& path);

/// Joints of several cameras' files: those of the first, then what others have beside them.
std::vector<std::string> UnitedJoints(const std::vector<TrackedPoints>& cameras);

/// The tracks with their keypoints in the order of `skeleton`. Throws FormatError for a joint that the skeleton lacks.
std::vector<Pose2dTrack> ToSkeleton(std::vector<TrackedPoints> cameras, const geometry::Skeleton& skeleton);

/// Points of caliscope's xy_TRACKER.csv (columns sync_index; cam_id or port; keypoint_id or point_id; img_loc_x, img_loc_y;
/// objects become people). Frames are sync_index. Cameras are called as `calib convert` calls those of camera_array.toml:
/// cam_<cam_id>. With a skeleton, the point's number is the joint's place in it, else the joints are called point_<number>;
/// points beyond the skeleton are counted in `num_beyond`.
struct CaliscopePoints {
  Pose2dSet set;
  size_t num_beyond = 0;
};
CaliscopePoints ReadCaliscopeCsv(const std::string& path, const geometry::Skeleton* skeleton = nullptr);

}  // namespace mvstudio::dataset
