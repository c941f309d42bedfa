#include "stages/people/points_input.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/pose/markers.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/frame_notice.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

/// The rate that was asked for, else that of the points.
void SettleRate(const PointsArguments& arguments, dataset::Pose3d* pose, InputNotes* notes) {
  const double stated_hz = pose->frame_rate_hz;
  if (arguments.rate_hz != 0) {
    if (!dataset::IsFrameRate(arguments.rate_hz)) throw UsageError(std::string("option 'frame-rate' ") + dataset::kFrameRates);
    if (stated_hz > 0 && !dataset::IsSameRate(stated_hz, arguments.rate_hz)) {
      notes->warnings.push_back({"MRK-RATE",
                                 Format("%s says %g frames a second; option 'frame-rate' %g is used", arguments.path.c_str(),
                                        stated_hz, arguments.rate_hz),
                                 "positions stay as they are: only their times change"});
    }
    pose->frame_rate_hz = arguments.rate_hz;
  }
  if (!dataset::IsFrameRate(pose->frame_rate_hz))
    throw UsageError("option 'frame-rate': " + arguments.path +
                     " does not say how many frames a second it has; give those of the footage, e.g. option 'frame-rate' 60");
}

/// Whether a file marks positions that were filled: then those without views are, else none is.
void CountAsMeasured(dataset::Pose3d* pose) {
  const bool marks = std::any_of(pose->rows.begin(), pose->rows.end(), [](const auto& row) { return row.num_views > 0; });
  if (marks) return;
  for (dataset::JointRow& row : pose->rows) row.num_views = row.status == Status::kOk ? 1 : 0;
}

/// Keeps the frames of `ranges`; empty: all. Says what is beyond the last frame.
void KeepChosenFrames(const std::string& ranges, const std::string& path, dataset::Pose3d* pose, InputNotes* notes) {
  if (ranges.empty()) return;
  std::set<int> there;
  for (const dataset::JointRow& row : pose->rows) there.insert(row.frame);
  const FrameChoice choice =
      KnownFrames("option 'frames'", ParseRanges("option 'frames'", ranges), {there.begin(), there.end()}, path);
  NoteFrames(choice.beyond, notes);
  const auto gone = [&](const auto& row) { return !std::binary_search(choice.frames.begin(), choice.frames.end(), row.frame); };
  pose->rows.erase(std::remove_if(pose->rows.begin(), pose->rows.end(), gone), pose->rows.end());
}

}  // namespace

PointsInput ReadPointsInput(const PointsArguments& arguments, InputNotes* notes) {
  PointsInput input;
  dataset::MarkerFile file;
  input.pose = dataset::ReadPoints3d(arguments.path, arguments.unit, arguments.up, &file);
  input.is_run = file.unit.empty();
  notes->inputs.push_back(arguments.path);
  if (!input.is_run) {
    input.unit = file.unit, input.up = file.up.empty() ? (file.y_up ? "y" : "z") : file.up;
    for (const std::string& note : NotesOf(file, arguments.path))
      notes->warnings.push_back({"MRK-FILE", note, "check the file, or say what is meant: option 'unit', option 'up'"});
    const std::string conflict = UnitConflict(file, arguments.path);
    if (!conflict.empty()) notes->warnings.push_back({"MRK-UNIT", conflict, "name the unit: option 'unit' m, cm, mm or in"});
    CountAsMeasured(&input.pose);
  } else if (!arguments.unit.empty() || !arguments.up.empty()) {
    throw UsageError("option 'unit' and option 'up' are for files of other programs: points of mvstudio are in metres, " +
                     input.pose.world);
  }
  if (!arguments.skeleton.empty()) {
    UseSkeleton(geometry::SkeletonFrom(arguments.skeleton), arguments.path, &input.pose);
    if (geometry::IsSkeletonFile(arguments.skeleton)) notes->inputs.push_back(arguments.skeleton);
  }
  KeepChosenFrames(arguments.frames, arguments.path, &input.pose, notes);
  SettleRate(arguments, &input.pose, notes);
  return input;
}

}  // namespace mvstudio::stages
