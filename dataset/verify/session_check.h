#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/notice.h"
#include "core/progress.h"
#include "dataset/footage/frames.h"
#include "dataset/session/session.h"

namespace mvstudio::dataset {

struct InspectedFootage {
  std::string take, camera;
  std::string path;                 ///< as in the session
  std::optional<FootageInfo> info;  ///< none: it cannot be opened
  int64_t num_frames = 0;           ///< counted
  double duration_s = 0;
  bool sound = false;  ///< opened, and nothing is missing as far as it was read
};

struct SessionReport {
  std::vector<InspectedFootage> footage;
  std::vector<Notice> findings;
  int num_errors() const;
};

struct InspectOptions {
  bool allow_outside = false;
  bool compare = true;  ///< compare footage with the calibration, poses and other footage; find duplicate files
  bool decode = false;  ///< decode every frame, instead of reading only the packets
};

/// All findings, by code: SES-OUTSIDE, SES-MISSING, SES-DAMAGED, SES-NO-FOOTAGE, SES-SIZE, SES-RATE, SES-COUNT, SES-GAP,
/// SES-ROTATED, SES-SAME-FILE, SES-CALIB, SES-POSE, SES-KEY. Throws only when cancelled.
SessionReport InspectSession(const Session& session, const InspectOptions& options, const RunContext& run = {});

}  // namespace mvstudio::dataset
