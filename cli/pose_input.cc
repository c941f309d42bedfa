#include "cli/pose_input.h"

#include <algorithm>
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

std::string Join(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : " | ") + name;
  return text;
}

void ListSkipped(const std::vector<std::string>& skipped, CommandResult* result) {
  constexpr size_t kShown = 5;
  if (skipped.empty()) return;
  result->exit = kExitPartial;
  for (size_t i = 0; i < std::min(skipped.size(), kShown); ++i) {
    result->warnings.push_back({"POSE-SKIPPED", skipped[i], "the rest was used; run the detector again on these frames"});
  }
  if (skipped.size() > kShown) {
    result->warnings.push_back({"POSE-SKIPPED", "and " + std::to_string(skipped.size() - kShown) + " more", ""});
  }
}

void ReadTracks(const PoseArguments& arguments, CommandResult* result, PoseInput* input) {
  input->skeleton = body::SkeletonByName(arguments.skeleton.empty() ? "body25" : arguments.skeleton);
  std::set<std::string> seen;
  for (const std::string& text : arguments.pose2d) {
    const auto [camera, path] = SplitNamePath("--pose2d", text);
    if (!seen.insert(camera).second) throw UsageError("--pose2d names camera " + camera + " twice");
    input->tracks.push_back(dataset::ReadPose2d(path, camera, input->skeleton));
    result->inputs.push_back(path);
    ListSkipped(input->tracks.back().skipped, result);
  }
}

void ReadPoints(const PoseArguments& arguments, CommandResult* result, PoseInput* input) {
  const bool named = !arguments.skeleton.empty();
  dataset::Pose2dSet set =
      dataset::ReadPose2dCsv(arguments.points2d, named ? &body::SkeletonByName(arguments.skeleton) : nullptr);
  input->skeleton = std::move(set.skeleton);
  input->tracks = std::move(set.tracks);
  result->inputs.push_back(arguments.points2d);
  ListSkipped(set.skipped, result);
}

}  // namespace

void AddPoseArguments(CLI::App* sub, PoseArguments& arguments) {
  sub->add_option("--calib", arguments.calib, "calibration file: ours, Panoptic's, or any that calib convert reads")
      ->required();
  sub->add_option("--pose2d", arguments.pose2d,
                  "NAME=FOLDER of OpenPose JSON files, or NAME=FILE with the results of a whole video; once a camera");
  sub->add_option("--points2d", arguments.points2d,
                  "instead: table camera,frame,person,joint,x_px,y_px,score (CSV) of all cameras, for markers and animals");
  sub->add_option("--skeleton", arguments.skeleton,
                  Join(body::SkeletonNames()) + "; body25 unless given, of --points2d the joints in the file");
}

triangulate::TakeBody BodyOf(const body::Skeleton& skeleton) {
  return {static_cast<int>(skeleton.joints.size()), body::MirrorGroups(skeleton)};
}

PoseInput ReadPoseInput(const PoseArguments& arguments, CommandResult* result) {
  PoseInput input;
  result->inputs.push_back(arguments.calib);
  const calib::ImportedRig imported = ReadCalibrationFiles({arguments.calib}, {});
  AddNotes(imported.notes, result);
  input.rig = imported.rig;
  if (arguments.pose2d.empty() == arguments.points2d.empty()) throw UsageError("give either --pose2d or --points2d");
  if (arguments.points2d.empty()) {
    ReadTracks(arguments, result, &input);
  } else {
    ReadPoints(arguments, result, &input);
  }
  if (input.tracks.size() < 2) throw UsageError("at least two cameras are needed, --pose2d NAME=FOLDER once for each");
  input.limbs = Limbs(input.skeleton);
  input.frames = ToFrames(input.tracks, input.rig, arguments.calib);
  return input;
}

}  // namespace mvstudio::cli
