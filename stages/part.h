#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "stages/result.h"

/// A part of a stage that is kept for the stage itself, as tasks of a plan do it.
namespace mvstudio::stages {

enum class PartKind {
  kChoice,   ///< of a net, from all cameras
  kSamples,  ///< the frames of a camera from which others are learned
  kFrames,   ///< blocks of kKeptBlock frames of a camera
  kShare,    ///< every so many-th of what there is
};

struct StagePart {
  PartKind kind = PartKind::kChoice;
  std::string camera;
  int64_t first_block = 0, end_block = std::numeric_limits<int64_t>::max();  ///< of kFrames, up to before the last
  int index = 0, count = 1;                                                  ///< of kShare
};

/// "choice", "samples=CAMERA", "frames=CAMERA", "frames=CAMERA:3-5", "share=K/N". Throws UsageError.
StagePart ParsePart(const std::string& text);
std::string ToString(const StagePart& part);

struct PartReport {
  InputNotes notes;
  std::string part, out;
  std::vector<std::string> kept;  ///< KIND/KEY of what the stage will find
};

/// Writes `kept` as OUT/part.json.
void WritePart(const PartReport& report, const std::string& folder);

CommandResult Describe(const PartReport& report);

}  // namespace mvstudio::stages
