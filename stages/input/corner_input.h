#pragma once

#include <memory>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/corners/corner_files.h"
#include "calib/detect/detect_footage.h"
#include "core/progress.h"
#include "dataset/time/timeline.h"
#include "stages/result.h"
#include "stages/words.h"

namespace mvstudio::stages {

/// Source of board corners: footage of --camera, searched for --board, or a file, --corners.
struct CornerArguments {
  std::vector<calib::Board> boards;
  std::vector<NamedPath> cameras;
  std::string corners;
  std::vector<std::string> mirrored;  ///< names of cameras whose images are flipped left-right
  std::string timestamps;             ///< table of the footage's times on one clock; empty: none
  calib::FootageOptions footage;
  calib::CornerFileOptions corner_files;
  std::shared_ptr<const dataset::Timeline> timeline;  ///< of the footage; null: equal frame numbers are one time step
};

struct CornerInput {
  calib::CalibrateInput input;
  std::vector<calib::FootageDetections> found;  ///< of footage only
};

/// The timeline of a table of time stamps, where one is given, in place of any other; to be called when the footage is known.
/// Throws UsageError without footage, and as ReadTimestamps and BuildTimeline do.
void FillTimeline(CornerArguments* arguments, CommandResult* result);

/// Reads corners from either source, those of mirrored cameras as in images that are not flipped; image sizes are 0 where a
/// corner file does not state them. Notes become warnings, files inputs. Throws UsageError, IoError, FormatError.
CornerInput ReadCornerInput(const CornerArguments& arguments, const RunContext& run, CommandResult* result);

}  // namespace mvstudio::stages
