#include "stages/input/project_input.h"

#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "dataset/trackers/tracked_project.h"

namespace mvstudio::stages {
namespace {

void FillUnit(const dataset::TrackedProject& project, PoseArguments* pose, InputNotes* notes) {
  if (project.program != "anipose" || !pose->calib_unit.empty()) return;
  if (project.board_square > 0 && project.board_square < 1) return;  // squares of a metre and more are no board's
  pose->calib_unit = "mm";
  const std::string why = project.board_square > 0 ? Format("its board's squares are %g", project.board_square)
                                                   : std::string("config.toml states no square of its board");
  notes->warnings.push_back({"POSE-UNIT", "lengths of the anipose project are taken as mm: " + why,
                             "option 'unit' m, cm or in if its calibration counts in another unit"});
}

void WarnOfUnused(const dataset::TrackedProject& project, InputNotes* notes) {
  if (project.unused.empty()) return;
  notes->warnings.push_back({"POSE-PROJECT",
                             "settings of the project's configuration that are not used: " + SomeOf(project.unused, 30),
                             "options of this command are used instead"});
}

void WarnOfLeftOut(const dataset::TrackedProject& project, InputNotes* notes) {
  constexpr size_t kShown = 5;
  for (size_t i = 0; i < std::min(project.left_out.size(), kShown); ++i) {
    notes->warnings.push_back({"POSE-LEFT-OUT", project.left_out[i], "the other takes of the project can be used"});
  }
  if (project.left_out.size() > kShown) {
    notes->warnings.push_back({"POSE-LEFT-OUT", "and " + std::to_string(project.left_out.size() - kShown) + " more files", ""});
  }
}

}  // namespace

nlohmann::ordered_json ProjectJson(const ProjectInput& project) {
  return {{"program", project.program}, {"take", project.take}, {"filtered", project.filtered}};
}

ProjectInput FillFromProject(const std::string& folder, const SessionArguments& session, PoseArguments* pose,
                             InputNotes* notes) {
  if (!session.session.empty()) throw UsageError("give either option 'session' or option 'project'");
  if (!pose->pose2d.empty() || !pose->points2d.empty()) {
    throw UsageError("give either option 'project' or the 2D points, option 'pose2d' or 'points2d'");
  }
  const dataset::TrackedProject project = dataset::ReadTrackedProject(folder);
  const dataset::TrackedProject::Take& found = dataset::FindTake(project, session.take);
  if (pose->calib.empty()) {
    pose->calib = found.calibration;
    FillUnit(project, pose, notes);
  }
  pose->points2d = found.table, pose->bones = project.bones;
  for (const auto& [camera, path] : found.files) pose->pose2d.push_back({camera, path});
  if (pose->skeleton.empty()) pose->skeleton = project.settings.skeleton;
  if (pose->changes.frames.empty()) pose->changes.frames = project.settings.frames;
  WarnOfUnused(project, notes);
  WarnOfLeftOut(project, notes);
  return {project.program, found.name, found.filtered, project.settings, project.notes};
}

}  // namespace mvstudio::stages
