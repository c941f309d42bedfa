#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "avatar/io/lift/lift_samples.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose3d.h"

namespace mvstudio::avatar {

using LiftJoints = Eigen::Matrix<double, 3, kLiftJoints>;

/// How far lifted joints are from the true ones; root-relative. Mean over joints and frames, mm.
struct LiftScore {
  int frames = 0;
  double mpjpe_mm = 0;             ///< mean distance after the roots (middle of the hips) are brought together
  double scaled_mpjpe_mm = 0;      ///< and the best size of each pose is taken
  double procrustes_mpjpe_mm = 0;  ///< after the best rotation, translation and size of each pose
  double root_mm = 0;              ///< mean distance of the roots; NaN when places were not asked for
  double acceleration_mm = 0;      ///< mean length of the second difference over neighbouring frames, mm a frame^2
  double true_acceleration_mm = 0;
};

/// A pose beside the truth, both in metres and in the same axes.
struct LiftPair {
  int frame = 0;
  LiftJoints x, truth;
  std::array<bool, kLiftJoints> valid{};  ///< known on both sides; the root must be
};

/// Pairs with fewer than 3 valid joints or no root are left out. Frames of one camera in ascending order.
LiftScore ScoreLift(const std::vector<std::vector<LiftPair>>& cameras, bool with_root);

/// A set of known poses in their views: the two things to beat.
class LiftBaselines {
 public:
  /// `count` samples without noise, missing joints or turned limbs.
  LiftBaselines(const std::vector<LiftSequence>& sequences, const LiftSampleOptions& options, int count, uint64_t seed);

  const LiftJoints& mean_pose() const { return mean_; }  ///< in sizes
  /// The known pose whose middle frame looks most like this one: smallest mean squared distance of the joints seen in both, in
  /// the coordinates of the network's input.
  const LiftJoints& Nearest(const LiftInput& input) const;

 private:
  std::vector<LiftSample> samples_;
  LiftJoints mean_ = LiftJoints::Zero();
};

/// What the cameras of a rig would see of the dataset's poses in the given frames, `noise_px` off: frame -> view.
std::map<int, LiftView> SimulatedViews(const dataset::PanopticDataset& data, int person, const geometry::RigCamera& camera,
                                       const std::vector<int>& frames, double noise_px, Rng& rng);

/// Windows of five neighbouring frames (`stride` apart) of a take as inputs of the network: frame -> input, every frame of
/// `views`.
std::map<int, LiftInput> LiftInputs(const std::map<int, LiftView>& views, int stride,
                                    const std::optional<Eigen::Vector3d>& up_in_cam);

}  // namespace mvstudio::avatar
