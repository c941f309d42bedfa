#pragma once

#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "geometry/skeleton/skeleton.h"

namespace mvstudio::dataset {

struct Keypoint2d {
  double x_px = 0, y_px = 0;
  double score = 0;  ///< above 0: detected; as the file counts until ScoresToShares (score_scale.h)
};

/// One person's keypoints in one image, in the order of the skeleton.
struct Person2d {
  std::vector<Keypoint2d> keypoints;
};

/// Detections of one camera: frame number -> people in that image (possibly none).
struct Pose2dTrack {
  std::string camera;
  std::map<int, std::vector<Person2d>> frames;
  std::vector<std::string> skipped = {};  ///< unreadable parts that were left out: "FILE: place: why", one per frame
  bool every_frame = false;               ///< its program lists frames in which it found nobody, too
  bool normalized = false;                ///< x and y are shares of the image's width and height (YOLO), not pixels
};

/// Frames to read, both ends included.
struct FrameRange {
  int first = 0, last = std::numeric_limits<int>::max();
  bool is_part = false;  ///< of a take: unreadable files are listed, however many there are
  size_t every = 1;      ///< of the files in the range, one in so many
};

/// Reads a folder of OpenPose JSON files (`*.json`, one per frame). The frame number is the last run of digits in the file
/// name before `_keypoints` or the extension. Without JSON, YOLO's labels of a pose model (`*.txt`): a normalized track. A
/// skeleton of several parts takes them from `pose_keypoints_2d`, `face_keypoints_2d`, `hand_left_keypoints_2d` and
/// `hand_right_keypoints_2d` (an empty list: not detected). All come from `pose_keypoints_2d` where that list is long enough.
/// People without a body are left out.
///
/// Unreadable files are left out and listed, unless they are more than half: then the first one's error is thrown. Throws
/// IoError for a missing or empty folder. Throws FormatError (path, place) for truncated JSON, invalid numbers, or a
/// keypoint count that does not fit the skeleton (with the skeleton that would fit). Two files of one frame number, and a
/// file name without one, always throw.
Pose2dTrack ReadOpenPoseFolder(const std::string& folder, const std::string& camera, const geometry::Skeleton& skeleton,
                               const FrameRange& range = {});

/// The same for a folder that is read in parts: its files are listed once, which takes longer than a part of a long take.
class OpenPoseFolder {
 public:
  /// Lists the files. Errors as in ReadOpenPoseFolder.
  OpenPoseFolder(const std::string& folder, const std::string& camera);
  std::vector<int> Frames() const;  ///< ascending
  size_t num_files() const { return files_.size(); }
  Pose2dTrack Read(const geometry::Skeleton& skeleton, const FrameRange& range = {}) const;

 private:
  std::string folder_, camera_;
  std::vector<std::pair<int, std::string>> files_;  ///< frame and name, ascending
};

/// The frame numbers in a folder, without reading the files. Errors as in ReadOpenPoseFolder.
std::vector<int> OpenPoseFrames(const std::string& folder, const std::string& camera);

/// Reads one JSON file of a whole video: a list of detections with `image_id` and `keypoints` (COCO results, AlphaPose),
/// or MMPose's `instance_info` (`frame_id`, `instances` with `keypoints` and `keypoint_scores`). The frame number is the
/// number itself or the last run of digits in its text. Where the file names its joints, they are found by their names, in
/// whatever order it has them. Unreadable entries are treated like the files above. Frames
/// without any detection are not in a COCO list.
Pose2dTrack ReadPoseResults(const std::string& path, const std::string& camera, const geometry::Skeleton& skeleton);

/// ReadOpenPoseFolder for a folder, ReadPoseResults for a file.
Pose2dTrack ReadPose2d(const std::string& path, const std::string& camera, const geometry::Skeleton& skeleton);

/// The joints that a JSON file names itself, in its order: those of COCO's `categories`, of MMPose's `meta_info`, or of
/// keypoints that bear a `name` or `part`. A known skeleton that has the same joints, in whatever order; else these points,
/// with the bones of COCO's categories. Nothing: the file names none, or cannot be read.
std::optional<geometry::Skeleton> SkeletonStatedIn(const std::string& path);

/// Writes one file per frame, `%012d_keypoints.json`, OpenPose 1.3 layout; split into the parts of `skeleton` when it is
/// given.
void WriteOpenPoseFolder(const Pose2dTrack& track, const std::string& folder, const geometry::Skeleton* skeleton = nullptr);

/// 2D points of all cameras.
struct Pose2dSet {
  geometry::Skeleton skeleton;
  std::vector<Pose2dTrack> tracks;        ///< by order of first appearance in the file
  std::vector<std::string> skipped = {};  ///< rows that were left out: "FILE: line 17: why"
  double time_step = 0;                   ///< frames were numbered by times, one in so many of their unit; 0: the file does
};

/// Reads a CSV file with the columns `camera,frame,person,joint,x_px,y_px,score` in any order, named in the first line.
/// Other columns are ignored; `score` (default 1) and `person` (default 0) may be missing. `person` is the detection's
/// number in that image; it does not link images. Without `frame`, a column of times tells it (FramesOfTimes). Without a
/// skeleton the joints are those of the file by order of first appearance (PointsSkeleton). An empty x_px, y_px or a score of
/// 0: not detected.
///
/// Rows that cannot be read or are not finite, and both of two rows for one point, are left out and listed. If they are
/// more than half, the first one's error is thrown. Throws IoError, FormatError (path, line); always for a missing column
/// and for a joint that is not in the given skeleton.
/// With `only_camera` the file is that camera's, and needs no column of cameras.
Pose2dSet ReadPose2dCsv(const std::string& path, const geometry::Skeleton* skeleton = nullptr,
                        const std::string& only_camera = "");

/// Writes the same columns; keypoints with score 0 are left out. Reading the file with the same skeleton gives the same
/// numbers if every person has a joint with a score.
void WritePose2dCsv(const Pose2dSet& set, const std::string& path);

}  // namespace mvstudio::dataset
