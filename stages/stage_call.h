#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "stages/result.h"

/// Stages that do others as a user would: by their command lines.
namespace mvstudio::stages {

struct LineOption {
  std::string name;  ///< of its field
  std::vector<std::string> values;
};

struct CommandLine {
  std::vector<std::string> command;      ///< its words and what it is given without an option
  std::vector<LineOption> options = {};  ///< one without values is a switch
  std::vector<std::string> typed = {};   ///< what a user adds to them, as it was typed

  /// As it is typed, without the program's name.
  std::vector<std::string> Words() const;
  /// "mvstudio dataset pack demo/dataset --out pack"
  std::string Text() const;
};

struct CallOutcome {
  CommandResult result;
  double seconds = NAN;      ///< NaN: it ended before it could say so
  double peak_rss_mb = NAN;  ///< of a process of its own
  double cpu_s = NAN;        ///< user and system time of a process of its own and of those that it started
};

/// Does what the line does when it is typed, and keeps its result in its folder. What goes wrong there is in the outcome.
using StageCall = std::function<CallOutcome(const CommandLine&)>;

/// The same in a process of its own, whose files lie below `folder` meanwhile; `poll` is called about 20 times a second and may
/// throw to end it.
using ChildCall = std::function<CallOutcome(const CommandLine&, const std::string& folder, const std::function<void()>& poll)>;

}  // namespace mvstudio::stages
