#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "body/dynamic/far_blocks.h"
#include "body/dynamic/linear_training.h"

namespace mvstudio::body {

/// Whether a body's surface moves with its pose beyond skinning, and how that is trained.
enum class DynamicMode {
  kAuto,    ///< offsets linear in the bones' turns, where they beat skinning in poses far from those trained on
  kOff,     ///< skinning alone
  kLinear,  ///< offsets linear in the bones' turns, whatever the judge says
};
std::string_view ToString(DynamicMode mode);                  ///< "auto", "off", "linear"
void FromString(const std::string& text, DynamicMode* mode);  ///< throws UsageError

/// A way to train offsets on some time steps; nothing where it cannot.
struct OffsetTrainer {
  std::string name;
  std::function<std::optional<LinearOffsets>(const std::vector<int>& indices)> train;
};

struct DynamicCandidate {
  std::string name;
  std::vector<BlockGain> gains;
  double mean_gain = 0;  ///< over all blocks, of IoU; NaN where it could not be trained
  double seconds = 0;
  bool beats = false, kept = false;
};

/// What the judge found, and the offsets to use.
struct DynamicFit {
  std::vector<DynamicCandidate> candidates;
  std::optional<LinearOffsets> offsets;  ///< trained on all time steps
  std::string reason;                    ///< one line: why there are offsets, or none; empty: nobody asked
  double rms_m = 0, most_m = 0;          ///< of the offsets in the poses of the take
};

/// Linear offsets of four sizes, from stiff to soft. The training must outlive them.
std::vector<OffsetTrainer> LinearTrainers(LinearTraining* training);

/// The trainer with the largest mean gain among those that beat skinning in every block; with `always` the best one even so.
DynamicFit FitDynamic(const TakeOutlines& take, const std::vector<OffsetTrainer>& trainers, bool always, const RunContext& run);

/// The same for a person whose surface was fitted to `steps`, without the silhouettes that the fit rejected: linear offsets,
/// added to the body's pose directions where they are kept.
DynamicFit FitMovingSurface(const std::vector<FitStep>& steps, const std::vector<RejectedView>& rejected, DynamicMode mode,
                            const RunContext& run, PersonBody* person);

}  // namespace mvstudio::body
