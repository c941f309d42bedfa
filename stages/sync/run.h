#pragma once

#include <optional>
#include <string>

#include "core/progress.h"
#include "dataset/time/motion_sync.h"
#include "dataset/time/sync_file.h"
#include "stages/input/project_input.h"
#include "stages/input_notes.h"
#include "stages/sync/options.h"
#include "triangulate/sync/sync.h"

namespace mvstudio::stages {

struct SyncReport {
  InputNotes notes;
  std::optional<ProjectInput> project;
  SyncSource from = SyncSource::kPoses;
  double fps_hz = 0;  ///< 0: not known
  dataset::SyncFile file;
  std::optional<triangulate::SyncResult> by_poses;  ///< offsets count the frames of the cameras' own numbers
  bool began_by_time_codes = false;                 ///< poses were searched from the offsets of the videos' time codes
  std::optional<dataset::MotionSync> by_motion;
  std::string folder, path;  ///< of sync.json
  bool kept_older = false;   ///< nothing was found, and the file of an earlier run stays

  int num_ok() const;
  /// No camera has an offset beside a reference of its own.
  bool Failed() const;
};

/// Offsets of the cameras' frame numbers, written as sync.json. Throws UsageError, IoError and FormatError; a camera without an
/// offset is no error (SyncedCamera::status).
SyncReport RunSync(SyncOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
