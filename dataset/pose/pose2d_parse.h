// Private: nlohmann's JSON, for the readers of 2D poses.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "dataset/pose/pose2d.h"

/// Shared by the readers of 2D poses.
namespace mvstudio::dataset::internal {

/// Last run of digits of the name without `_keypoints` and extension; empty when there is none or it has more than 9
/// digits.
std::optional<int> FrameNumber(const std::string& file_name);

/// The frames of files or images by their names: the last number, as FrameNumber; where two share it, as footage is numbered
/// (NumberFrames): 000012_1 of camera 1 is frame 12. Names without a number have none.
std::map<std::string, std::optional<int>> FramesOfNames(const std::vector<std::string>& names);

/// Place of an error for messages, and the expected content of the file.
struct PoseFile {
  std::string path, place;
  const geometry::Skeleton& skeleton;

  [[noreturn]] void Fail(const std::string& where, const std::string& what) const {
    throw FormatError(path, place + (place.empty() || where.empty() ? "" : ", ") + where, what);
  }
};

/// NaN and infinities, as Python's json writes them, become null. Throws FormatError for damaged JSON, and for JSON nested
/// deeper than 16 levels.
nlohmann::json ParsePoseJson(const std::string& text, const PoseFile& file);

/// Appends `num_joints` keypoints from a flat list x, y, score, …; `where` names the list. One with a null is not detected.
void AppendKeypoints(const nlohmann::json& numbers, size_t num_joints, const std::string& where, const PoseFile& file,
                     Person2d* person);

/// Appends a person of MMPose (`keypoints` [[x, y], …] and `keypoint_scores`) or of COCO's kind (one flat `keypoints`).
void AppendPerson(const nlohmann::json& entry, const std::string& where, const PoseFile& file, std::vector<Person2d>* people);

/// The name that a keypoint bears itself, {"name": "nose", "x": …}; empty: none.
std::string NameOfPoint(const nlohmann::json& point);

/// The joints that a file names itself (SkeletonStatedIn), in its order and by its names.
std::optional<geometry::Skeleton> StatedSkeleton(const nlohmann::json& root);

/// Whether its keypoints bear their names themselves: those that are nowhere in it were not detected. Others list all joints.
bool MayLeaveOutJoints(const nlohmann::json& root);

/// People in the order of `stated` become people in that of the file's skeleton, found by name. Throws FormatError for a joint
/// that the file does not name, and with `may_leave_out` only if it names none.
void ToAskedJoints(const geometry::Skeleton& stated, bool may_leave_out, const PoseFile& file, std::vector<Person2d>* people);

/// The skeletons with as many joints, as advice.
std::string FittingSkeletons(size_t num_joints);

/// The people of an image in YOLO's labels of a pose model, a line each: class, box (4 numbers), then x, y and visibility or
/// confidence of each joint, or x and y (0 0: not labelled), perhaps a confidence and a track; x and y are shares of the
/// image's width and height, and stay so. Throws FormatError.
std::vector<Person2d> ParseYoloLabels(const std::string& text, const PoseFile& file);

/// Runs `read` and turns a FormatError into a line of `skipped`. Gives up after tens of thousands of errors with almost
/// nothing readable.
class Tolerant {
 public:
  explicit Tolerant(std::vector<std::string>* skipped) : skipped_(skipped) {}
  void Try(const std::function<void()>& read);
  /// Call after the last Try: throws the first error when more than half failed.
  void Finish() const;

 private:
  std::vector<std::string>* skipped_;
  std::optional<FormatError> first_;
  int64_t num_tried_ = 0, num_failed_ = 0;
};

}  // namespace mvstudio::dataset::internal
