#include "dataset/build/read_joints.h"

#include <algorithm>
#include <set>

#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "dataset/build/joint_numbers.h"
#include "dataset/build/scene_joints.h"
#include "dataset/pose/markers.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset::internal {
namespace {

/// A dataset without a single joint would look like one.
void RequireJoints(const std::string& path, const Pose3d& pose) {
  const auto ok = [](const JointRow& row) { return row.status == Status::kOk; };
  if (std::none_of(pose.rows.begin(), pose.rows.end(), ok)) throw FormatError(path, "", "holds no point");
}

Pose3d ReadPointsOf(const BuildInputs& inputs, BuildReport* report) {
  MarkerFile file;
  Pose3d pose = ReadPoints3d(inputs.pose3d, inputs.marker_unit, "", &file);
  if (file.unit.empty()) return pose;  // points of mvstudio
  report->marker_unit = file.unit, report->marker_up = file.y_up ? "y" : "z";
  const std::string conflict = UnitConflict(file, inputs.pose3d);
  if (!conflict.empty())
    report->warnings.push_back({"DAT-UNIT", conflict, "name the unit: option 'marker-unit' m, cm, mm or in"});
  for (const std::string& note : NotesOf(file, inputs.pose3d))
    report->warnings.push_back({"DAT-MARKER-FILE", note, "check the file, or export it again"});
  return pose;
}

void KeepTimeSteps(const BuildInputs& inputs, Pose3d* pose, BuildReport* report) {
  if (inputs.frames.empty()) return;
  std::set<int> there;
  for (const JointRow& row : pose->rows) there.insert(row.frame);
  const FrameChoice choice = KnownFrames("option 'frames'", inputs.frames, {there.begin(), there.end()}, inputs.pose3d);
  if (!choice.beyond.empty())
    report->warnings.push_back({"CLI-FRAMES", choice.beyond, "look at the numbers: time steps are those of the joints"});
  const auto gone = [&](const JointRow& row) {
    return !std::binary_search(choice.frames.begin(), choice.frames.end(), row.frame);
  };
  pose->rows.erase(std::remove_if(pose->rows.begin(), pose->rows.end(), gone), pose->rows.end());
}

}  // namespace

Pose3d ReadJointsOf(const BuildInputs& inputs, BuildReport* report) {
  Pose3d pose = SceneFilesAt(inputs.pose3d).empty() ? ReadPointsOf(inputs, report) : ReadSceneJoints(inputs.pose3d);
  if (!inputs.skeleton.empty()) UseSkeleton(geometry::SkeletonFrom(inputs.skeleton), inputs.pose3d, &pose);
  NumberJointsAsFrames(inputs, &pose, &report->warnings);
  KeepTimeSteps(inputs, &pose, report);
  RequireJoints(inputs.pose3d, pose);
  return pose;
}

}  // namespace mvstudio::dataset::internal
