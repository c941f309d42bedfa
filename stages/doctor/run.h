#pragma once

#include <optional>
#include <vector>

#include "core/progress.h"
#include "dataset/verify/session_check.h"
#include "stages/doctor/machine.h"
#include "stages/doctor/options.h"
#include "stages/input_notes.h"

namespace mvstudio::stages {

struct DoctorReport {
  MachineState machine;
  std::optional<dataset::SessionReport> session;
  InputNotes notes;
};

/// Looks at the machine, and at every file of a session or of a folder of footage. Throws IoError where there is neither,
/// FormatError.
DoctorReport RunDoctor(const DoctorOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
