#include <cmath>
#include <set>

#include "dataset/panoptic/own_joints.h"
#include "dataset/verify/findings.h"
#include "dataset/verify/verify_steps.h"

namespace mvstudio::dataset::internal {
namespace {

/// People that one of two files of a frame lacks.
std::vector<int> Differing(const std::map<int, JointsPose>& own, const std::map<int, Coco19Pose>& people) {
  std::set<int> ids;
  for (const auto& [id, pose] : own) ids.insert(id);
  for (const auto& [id, pose] : people) {
    if (!ids.insert(id).second) ids.erase(id);
  }
  return {ids.begin(), ids.end()};
}

struct OwnFaults {
  std::vector<int> strangers, without_scene, without_own;
};

void ReportOwn(const OwnFaults& faults, const std::string& folder, Findings* findings) {
  const auto say = [&](const std::vector<int>& frames, const std::string& what) {
    if (!frames.empty()) findings->Error("DAT-POSE", folder, what + FramesText(frames));
  };
  say(faults.strangers, "other people than in hdPose3d_stage1_coco19 in ");
  say(faults.without_scene, "hdPose3d_stage1_coco19 lacks ");
  say(faults.without_own, "hdPose3d_stage1_coco19 alone has ");
}

int CheckOwnFiles(const OwnJoints& joints, const std::map<int, Body3dScene>& scenes, const std::string& folder,
                  Findings* findings) {
  OwnFaults faults;
  int readable = 0;
  for (const auto& [frame, path] : joints.files) {
    const auto scene = scenes.find(frame);
    if (scene == scenes.end()) faults.without_scene.push_back(frame);
    try {
      const auto people = ReadOwnScene(path, joints.skeleton);
      ++readable;
      if (scene != scenes.end() && !Differing(people, scene->second.people).empty()) faults.strangers.push_back(frame);
    } catch (const FormatError& error) {
      findings->Error("DAT-POSE", path, WithoutPath(error));
    }
  }
  for (const auto& [frame, scene] : scenes) {
    if (!joints.files.count(frame)) faults.without_own.push_back(frame);
  }
  ReportOwn(faults, folder, findings);
  return readable;
}

}  // namespace

int VerifyOwnJoints(const std::string& root, const std::map<int, Body3dScene>& scenes, std::string* skeleton,
                    Findings* findings) {
  std::string folder = root;
  try {
    folder = FindOwnJoints(root);
    if (folder.empty()) return 0;
    const OwnJoints joints = ListOwnJoints(folder);
    *skeleton = joints.skeleton.name;
    return CheckOwnFiles(joints, scenes, folder, findings);
  } catch (const FormatError& error) {
    findings->Error("DAT-POSE", error.path(), WithoutPath(error));
  } catch (const IoError& error) {
    findings->Error("DAT-POSE", folder, error.what());
  }
  return 0;
}

}  // namespace mvstudio::dataset::internal
