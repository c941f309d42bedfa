#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cli/program/run_line.h"
#include "stages/stage_call.h"

/// Stages of a longer command: each does what `mvstudio WORDS…` does, and keeps a result of its own in its folder.
namespace mvstudio::cli {

enum class StageMode {
  /// In this process, with the progress, threads and seed of the context. It begins at once and finds libraries loaded; memory
  /// that it does not give back and what it sets in libtorch stay. For stages that run once.
  kHere,
  /// As a child, exactly as `mvstudio WORDS… --json` would be typed: threads and seed are named in WORDS. Its memory and the
  /// state of libtorch end with it, and the peak memory in its result is its own. For stages that are repeated or measured.
  kChild
};

struct StageOptions {
  StageMode mode = StageMode::kHere;
  std::string folder = {};          ///< kChild: exists; what the child prints lies below it until the child ends
  std::function<void()> poll = {};  ///< kChild: called about 20 times a second; may throw to end the child
};

/// Whatever goes wrong in the stage is in its outcome; a child that was ended before it could say so has a status and no
/// errors. With kChild throws what `poll` throws, IoError when the child cannot be started or awaited, FormatError when it
/// prints no result.
LineOutcome RunStage(const std::vector<std::string>& words, const CommandContext& context, const StageOptions& options = {});

/// How the stages of `context`'s command do others: here, or as children.
stages::StageCall CallsIn(const CommandContext& context);
stages::ChildCall ChildCallsIn(const CommandContext& context);

}  // namespace mvstudio::cli
