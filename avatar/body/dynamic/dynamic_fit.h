#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "avatar/body/dynamic/far_blocks.h"
#include "avatar/body/dynamic/linear_training.h"

namespace mvstudio::body {

/// Whether a body's surface moves with its pose beyond skinning, and how that is trained.
enum class DynamicMode {
  kAuto,     ///< linear or a network's, where they beat skinning in poses far from those trained on
  kOff,      ///< skinning alone
  kLinear,   ///< offsets linear in the bones' turns, whatever the judge says
  kNetwork,  ///< a network's offsets, whatever the judge says
};
std::string_view ToString(DynamicMode mode);                  ///< "auto", "off", "linear", "network"
void FromString(const std::string& text, DynamicMode* mode);  ///< throws UsageError

/// Offsets of one kind or the other.
struct TrainedOffsets {
  std::optional<LinearOffsets> linear;
  std::shared_ptr<const MovingOffsets> network;  ///< null: linear

  /// (3, V) at rest, metres, of the body that they were trained on.
  Eigen::Matrix3Xf At(const BodyTemplate& body, const ArticulatedPose& pose) const;
};

/// Gives the offsets to a body: AddLinearOffsets, or as its moving offsets.
void AddOffsets(const TrainedOffsets& offsets, BodyTemplate* body);

/// A way to train offsets on some time steps; nothing where it cannot.
struct OffsetTrainer {
  std::string name;
  std::function<std::optional<TrainedOffsets>(const std::vector<int>& indices)> train;
};
/// Makes a trainer of a network; the take must outlive it.
using MakeNetworkTrainer = std::function<OffsetTrainer(const TakeOutlines& take)>;

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
  std::optional<TrainedOffsets> offsets;  ///< trained on all time steps
  std::string reason;                     ///< one line: why there are offsets, or none; empty: nobody asked
  double rms_m = 0, most_m = 0;           ///< of the offsets in the poses of the take
};

/// Linear offsets of four sizes, from stiff to soft. The training must outlive them.
std::vector<OffsetTrainer> LinearTrainers(LinearTraining* training);

/// The trainer with the largest mean gain among those that beat skinning in every block; with `always` the best one even so.
DynamicFit FitDynamic(const TakeOutlines& take, const std::vector<OffsetTrainer>& trainers, bool always, const RunContext& run);

/// The same for a person whose surface was fitted to `steps`, without the silhouettes that the fit rejected. Offsets that are
/// kept are given to the body. Without `network`, kAuto knows
/// linear ones alone.
DynamicFit FitMovingSurface(const std::vector<FitStep>& steps, const std::vector<RejectedView>& rejected, DynamicMode mode,
                            const MakeNetworkTrainer& network, const RunContext& run, PersonBody* person);

}  // namespace mvstudio::body
