#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "avatar/run/lift/lift_samples.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose3d.h"

namespace mvstudio::avatar {

using LiftJoints = Eigen::Matrix<double, 3, kLiftJoints>;

/// Errors of lifted joints; root-relative. Mean over joints and frames, mm.
struct LiftScore {
  int frames = 0;
  double mpjpe_mm = 0;             ///< mean distance after aligning the roots (middle of the hips)
  double scaled_mpjpe_mm = 0;      ///< also with the best size of each pose
  double procrustes_mpjpe_mm = 0;  ///< after the best rotation, translation and size of each pose
  double root_mm = 0;              ///< mean distance of the roots; NaN when positions were not requested
  double acceleration_mm = 0;      ///< mean length of the second difference over neighbouring frames, mm per frame^2
  double true_acceleration_mm = 0;
};

/// A pose and its truth, both in metres and in the same axes.
struct LiftPair {
  int frame = 0;
  LiftJoints x, truth;
  std::array<bool, kLiftJoints> valid{};  ///< known on both sides; the root must be
};

/// Pairs with fewer than 3 valid joints or no root are left out. Frames of one camera in ascending order.
LiftScore ScoreLift(const std::vector<std::vector<LiftPair>>& cameras, bool with_root);

/// Baselines from a set of known poses in their views.
class LiftBaselines {
 public:
  /// `count` samples without noise, missing joints or rotated limbs.
  LiftBaselines(const std::vector<LiftSequence>& sequences, const LiftSampleOptions& options, int count, uint64_t seed);

  const LiftJoints& mean_pose() const { return mean_; }  ///< in sizes
  /// The known pose with the most similar middle frame: smallest mean squared distance of the joints seen in both, in the
  /// coordinates of the network's input.
  const LiftJoints& Nearest(const LiftInput& input) const;

 private:
  std::vector<LiftSample> samples_;
  LiftJoints mean_ = LiftJoints::Zero();
};

/// Simulated views of the dataset's poses in the given frames, with noise of `noise_px`: frame -> view.
std::map<int, LiftView> SimulatedViews(const dataset::PanopticDataset& data, int person, const geometry::RigCamera& camera,
                                       const std::vector<int>& frames, double noise_px, Rng& rng);

/// Windows of five neighbouring frames (`stride` apart) of a take as inputs of the network: frame -> input, every frame of
/// `views`.
std::map<int, LiftInput> LiftInputs(const std::map<int, LiftView>& views, int stride,
                                    const std::optional<Eigen::Vector3d>& up_in_cam);

}  // namespace mvstudio::avatar
