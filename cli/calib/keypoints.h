#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/refine.h"
#include "cli/program/command.h"
#include "stages/input/pose_changes.h"

namespace mvstudio::cli {

/// `mvstudio calib refine --from-keypoints`: the rig is adjusted to people, markers or animals instead of boards.
struct KeypointArguments {
  bool from_keypoints = false;
  std::string skeleton;                   ///< "": body25, or the points that the table names
  std::string train_frames, test_frames;  ///< "START:STEP"; "": see calib/keypoints/refine.h
  std::string calib_unit;                 ///< of a calibration that names none
  std::string points2d;                   ///< table of points of all cameras, instead of pose2d
  double person_height_m = 0;             ///< 0: not said; for lenses without poses
  std::vector<stages::NamedPath> pose2d;
  std::vector<std::string> lengths;  ///< see calib/points/stated_length.h
  stages::PoseChanges changes;
  std::string sync;  ///< sync.json; may be empty

  bool IsGiven() const { return from_keypoints || !points2d.empty(); }
  calib::KeypointRefineOptions options;
};

/// --from-keypoints, --pose2d, --points2d, --skeleton, --train-frames, --test-frames and the options.
void AddKeypointArguments(CLI::App* sub, KeypointArguments& arguments);

/// Writes calibration.json to the folder `out`: the adjusted rig, or the given one when nothing explains held-out frames
/// better.
CommandResult RunKeypoints(const KeypointArguments& arguments, const std::string& calib_path, const std::string& out,
                           CommandContext& context);

}  // namespace mvstudio::cli
