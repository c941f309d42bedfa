#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/progress.h"
#include "stages/budget/report.h"
#include "stages/part.h"
#include "stages/input_notes.h"
#include "stages/nets/mask/input.h"

namespace mvstudio::stages {

enum class MaskOutcome {
  kMade,
  kNobody,  ///< nothing separates people from background in some camera: there are no masks
};

struct MaskStageReport {
  MaskStageOptions options;  ///< as the session settled them
  InputNotes notes;
  MaskOutcome outcome = MaskOutcome::kMade;
  std::vector<MaskTrial> trials;  ///< without their models
  size_t chosen = 0;              ///< of the trials; its failed camera is the reason of kNobody

  struct Camera {
    std::string name;
    std::vector<std::string> damage;  ///< of the footage, one line each
  };
  std::vector<Camera> cameras;
  MaskRunResult masks;                             ///< its cameras in the same order
  std::optional<std::pair<int, int>> pose_frames;  ///< first and last of the 3D joints, where there are some
  std::vector<TruthScore> truth;                   ///< of options.truth, in its order
  double wall_s = 0;
  std::optional<BudgetReport> budget;

  bool AllEmpty() const;
  /// Cameras in which no joint guided a mask, where joints were given.
  std::vector<std::string> WithoutJoints() const;
};

/// Makes masks and writes the folder options.out. Throws UsageError, IoError, FormatError, NothingLeftError and
/// MissingToolError; footage of which nothing can be learned is a report (MaskOutcome).
MaskStageReport RunMask(MaskStageOptions options, const RunContext& run = {});

/// Keeps the part options.part for RunMask with the same options and cache, and lists it in options.out. Throws as RunMask.
PartReport RunMaskPart(MaskStageOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
