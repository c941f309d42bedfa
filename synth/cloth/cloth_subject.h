#pragma once

#include <Eigen/Core>

#include "avatar/body/body_template.h"
#include "core/status.h"
#include "synth/cloth/cloth_sim.h"
#include "synth/cloth/dressed_body.h"
#include "synth/cloth/muscles.h"

namespace mvstudio::synth {

/// A body in the skirt and shirt that swing, as it moves.
class ClothSubject {
 public:
  ClothSubject(const body::BodyTemplate& body, uint64_t seed);
  const DressedBody& dressed() const { return dressed_; }
  const ClothSim& sim() const { return sim_; }

  /// Where skinning alone would have the surface; cloth rigidly with the bones. (3, V) in world
  Eigen::Matrix3Xf Skinned(const body::BodyPose& pose) const;
  /// Lets the cloth hang on the body at rest, for `kSettleS` seconds. From now on it begins like that, and so does the rest of
  /// dressed().surface, which skinning moves: what is constant is not beyond skinning.
  Status Settle();
  static constexpr double kSettleS = 4;

  /// The cloth as skinning has it in this pose, at rest.
  Status Reset(const body::BodyPose& pose);
  /// The body takes this pose `step_s * steps` later.
  Status Advance(const body::BodyPose& pose, int steps, double step_s);
  /// The true surface after the last call. (3, V) in world
  const Eigen::Matrix3Xf& vertices() const { return vertices_; }

 private:
  void MoveBody(const body::BodyPose& pose);

  DressedBody dressed_;
  Muscles muscles_;
  ClothSim sim_;
  body::BodyTemplate swollen_, cloth_;  // the naked body with its muscles; the garments alone
  Eigen::Matrix3Xf vertices_;
};

}  // namespace mvstudio::synth
