#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/budget/report.h"
#include "stages/part.h"
#include "stages/input_notes.h"
#include "stages/nets/pose2d/choose.h"
#include "stages/nets/pose2d/detect.h"
#include "stages/nets/pose2d/options.h"
#include "stages/people/pose2d_quality.h"

namespace mvstudio::stages {

/// Footage of another size than the calibration states; px.
struct Pose2dOtherSize {
  std::string camera;
  int width_px = 0, height_px = 0;  ///< of the footage
  int calibrated_width_px = 0, calibrated_height_px = 0;
};

struct Pose2dReport {
  InputNotes notes;
  std::string out;  ///< as the session settled it
  std::string backend;
  std::vector<Pose2dTrial> trials;  ///< where the backend was chosen among several
  geometry::Skeleton skeleton;
  std::vector<CameraPoses> cameras;
  std::vector<Pose2dOtherSize> other_sizes;
  PoseAgreement agreement;
  std::optional<BudgetReport> budget;

  /// Somebody was found in some image.
  bool FoundPeople() const;
};

/// Detects keypoints, or reads those that are there, and writes the folder. Throws UsageError, IoError, FormatError,
/// NothingLeftError and MissingToolError; a camera without a result is a report unless all are.
Pose2dReport RunPose2d(const Pose2dOptions& options, const RunContext& run = {});

/// Keeps the part options.part for RunPose2d with the same options and cache, and lists it in options.out. A camera whose
/// footage cannot be read is a warning: the whole names it. Throws as RunPose2d.
PartReport RunPose2dPart(const Pose2dOptions& options, const RunContext& run = {});

/// OUT/overlay/CAMERA_%08d.jpg
std::string Pose2dOverlayPath(const std::string& out, const std::string& camera, int frame);

}  // namespace mvstudio::stages
