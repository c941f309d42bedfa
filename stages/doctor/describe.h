#pragma once

#include <string>

#include "stages/doctor/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// What the program is that asks.
struct ProgramFacts {
  std::string version;
  bool has_avatar = true;  ///< built with libtorch
};

/// The machine, what is short, and every finding of the session.
CommandResult Describe(const DoctorReport& report, const ProgramFacts& program);

}  // namespace mvstudio::stages
