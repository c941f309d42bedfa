#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "stages/input_notes.h"

/// The result of a stage of mvstudio: figures, files, warnings and exit code.
namespace mvstudio::stages {

/// Exit codes of the command-line contract.
enum ExitCode {
  kExitOk = 0,
  kExitInternal = 1,
  kExitUsage = 2,
  kExitBadInput = 3,
  kExitQualityGate = 4,  ///< computed, outputs kept, but a quality gate failed
  kExitIllPosed = 5,     ///< ill-posed or not converged
  kExitPartial = 6,      ///< some cameras or frames failed and are listed
  kExitResources = 7,
  kExitMissingTool = 8,
  kExitTryAgain = 75,
  kExitInterrupted = 130,
};

/// The result of a command. Exceptions become an `error` result with the exit code of their type.
/// Where its input was partial and nothing else is to be said, the exit code is kExitPartial.
struct CommandResult : InputNotes {
  int exit = kExitOk;
  nlohmann::ordered_json metrics = nlohmann::ordered_json::object();
  struct Output {
    std::string path;
    std::string role;  ///< "calibration", "points", "dataset", "checkpoint", "heldout-picture", …; may be empty
  };
  std::vector<Output> outputs;
  std::vector<Notice> errors;
  std::string text;  ///< printed to stdout without --json
  std::string
      folder;  ///< when set: the whole result is kept as folder/<command>.result.json and provenance.jsonl gets a line there
  std::string unchanged_since;  ///< UTC; of an earlier run of the same command line: nothing was done, and nothing is kept

  /// Appends what a part of the command has to say; its exit code, if it has one, and its metrics replace those of the same
  /// name.
  void Add(CommandResult part);
};

/// JSON has no NaN and no infinity: null for values that are not finite.
inline nlohmann::ordered_json FiniteOrNull(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

}  // namespace mvstudio::stages
