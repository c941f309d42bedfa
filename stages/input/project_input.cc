#include "stages/input/project_input.h"

#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "dataset/trackers/tracked_project.h"

namespace mvstudio::stages {
namespace {

void FillUnit(const dataset::TrackedProject& project, PoseArguments* pose, CommandResult* result) {
  if (project.program != "anipose" || !pose->calib_unit.empty()) return;
  if (project.board_square > 0 && project.board_square < 1) return;  // squares of a metre and more are no board's
  pose->calib_unit = "mm";
  const std::string why = project.board_square > 0 ? Format("its board's squares are %g", project.board_square)
                                                   : std::string("config.toml states no square of its board");
  result->warnings.push_back({"POSE-UNIT", "lengths of the anipose project are taken as mm: " + why,
                              "option 'unit' m, cm or in if its calibration counts in another unit"});
}

void WarnOfUnused(const dataset::TrackedProject& project, CommandResult* result) {
  if (project.unused.empty()) return;
  result->warnings.push_back({"POSE-PROJECT",
                              "settings of the project's configuration that are not used: " + SomeOf(project.unused, 30),
                              "options of this command are used instead"});
}

void WarnOfLeftOut(const dataset::TrackedProject& project, CommandResult* result) {
  constexpr size_t kShown = 5;
  for (size_t i = 0; i < std::min(project.left_out.size(), kShown); ++i) {
    result->warnings.push_back({"POSE-LEFT-OUT", project.left_out[i], "the other takes of the project can be used"});
  }
  if (project.left_out.size() > kShown) {
    result->warnings.push_back(
        {"POSE-LEFT-OUT", "and " + std::to_string(project.left_out.size() - kShown) + " more files", ""});
  }
}

}  // namespace

dataset::ProjectSettings FillFromProject(const std::string& folder, const SessionArguments& session, PoseArguments* pose,
                                         CommandResult* result) {
  if (!session.session.empty()) throw UsageError("give either option 'session' or option 'project'");
  if (!pose->pose2d.empty() || !pose->points2d.empty()) {
    throw UsageError("give either option 'project' or the 2D points, option 'pose2d' or 'points2d'");
  }
  const dataset::TrackedProject project = dataset::ReadTrackedProject(folder);
  const dataset::TrackedProject::Take& found = dataset::FindTake(project, session.take);
  if (pose->calib.empty()) {
    pose->calib = found.calibration;
    FillUnit(project, pose, result);
  }
  pose->points2d = found.table, pose->bones = project.bones;
  for (const auto& [camera, path] : found.files) pose->pose2d.push_back({camera, path});
  if (pose->skeleton.empty()) pose->skeleton = project.settings.skeleton;
  if (pose->changes.frames.empty()) pose->changes.frames = project.settings.frames;
  for (const std::string& note : project.notes) result->text += "project: " + note + "\n";
  WarnOfUnused(project, result);
  WarnOfLeftOut(project, result);
  result->metrics["project"] = {{"program", project.program}, {"take", found.name}, {"filtered", found.filtered}};
  return project.settings;
}

}  // namespace mvstudio::stages
