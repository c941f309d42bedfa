#include "cli/pose_input.h"

#include <set>

#include "cli/calib_read.h"
#include "cli/triangulate_take.h"
#include "core/error.h"

namespace mvstudio::cli {
namespace {

std::vector<std::pair<int, int>> Limbs(const body::Skeleton& skeleton) {
  std::vector<std::pair<int, int>> limbs;
  for (const std::string side : {"L", "R"}) {
    for (const auto& [from, to] : {std::pair("Shoulder", "Elbow"), {"Elbow", "Wrist"}, {"Hip", "Knee"}, {"Knee", "Ankle"}}) {
      const int a = skeleton.Find(side + from), b = skeleton.Find(side + to);
      if (a >= 0 && b >= 0) limbs.emplace_back(a, b);
    }
  }
  return limbs;
}

}  // namespace

void AddPoseArguments(CLI::App* sub, PoseArguments& arguments) {
  sub->add_option("--calib", arguments.calib, "calibration file: ours, Panoptic's, or any that calib convert reads")->required();
  sub->add_option("--pose2d", arguments.pose2d, "NAME=FOLDER of OpenPose JSON files; once a camera")->required();
  sub->add_option("--skeleton", arguments.skeleton, "body25 | body25b | coco17 | coco18 | coco19")->capture_default_str();
}

PoseInput ReadPoseInput(const PoseArguments& arguments, CommandResult* result) {
  PoseInput input;
  result->inputs.push_back(arguments.calib);
  input.skeleton = body::SkeletonByName(arguments.skeleton);
  input.limbs = Limbs(input.skeleton);
  const calib::ImportedRig imported = ReadCalibrationFiles({arguments.calib}, {});
  AddNotes(imported.notes, result);
  input.rig = imported.rig;
  std::set<std::string> seen;
  for (const std::string& text : arguments.pose2d) {
    const auto [camera, folder] = SplitNamePath("--pose2d", text);
    if (!seen.insert(camera).second) throw UsageError("--pose2d names camera " + camera + " twice");
    input.tracks.push_back(dataset::ReadOpenPoseFolder(folder, camera, input.skeleton));
    result->inputs.push_back(folder);
  }
  if (input.tracks.size() < 2) throw UsageError("--pose2d: at least two cameras are needed, given as NAME=FOLDER each");
  input.frames = ToFrames(input.tracks, input.rig, arguments.calib);
  return input;
}

}  // namespace mvstudio::cli
