#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/status.h"
#include "synth/cloth/cloth_net.h"
#include "synth/cloth/dressed_body.h"

namespace mvstudio::synth {

/// Cloth in motion: extended position-based dynamics (Macklin et al., "XPBD: position-based simulation of compliant constrained
/// dynamics", MIG 2016) in many small steps (Macklin et al., "Small steps in physics simulation", SCA 2019). Gravity acts along
/// -z; the cloth does not enter the body's skin and outer garments stay outside inner ones. It does not know itself: folds of
/// one garment may touch. One thread, so that results are the same bit for bit.
class ClothSim {
 public:
  /// `dressed` must outlive it. The cloth has no place before the first Reset.
  explicit ClothSim(const DressedBody& dressed, const ClothMaterial& material = {});

  /// Cloth at rest where skinning has it; `skinned` (3, V) is the whole surface in world.
  Status Reset(const Eigen::Matrix3Xf& skinned);

  /// The body moves to `skinned` (3, V in world; cloth's columns count where it is pinned) in `steps` equal steps of `step_s`.
  /// kNonFiniteInput: `skinned` is not finite, and nothing has moved. kNotConverged: the cloth is torn (edges of more than
  /// twice or less than a tenth their length) or faster than 30 m/s; after this only Reset is allowed.
  Status Advance(const Eigen::Matrix3Xf& skinned, int steps, double step_s);

  /// (3, N) of the garments' vertices in world, metres.
  const Eigen::Matrix3Xd& positions() const { return x_; }

  struct Energy {
    double kinetic_j = 0, gravity_j = 0, elastic_j = 0;
    double total_j() const { return kinetic_j + gravity_j + elastic_j; }
  };
  Energy energy() const;
  double max_speed() const;  ///< m/s
  /// Lengths of the edges along and around over those at rest: rms and greatest deviation from 1.
  struct Stretch {
    double rms = 0, max = 0;
  };
  Stretch stretch() const;

 private:
  struct Contact {
    int vertex;  // of the body, -1 for none
    Eigen::Vector3d from, to, normal_from, normal_to;
  };
  void FindContacts(const Eigen::Matrix3Xd& to);
  void SubStep(const Eigen::Matrix3Xd& to, double before, double after, double step_s);
  void SolveEdges(double step_s, bool backwards);
  void SolveBends(double step_s, bool backwards);
  void SolveLayers();
  void SolveContacts(double before, double after);
  bool Sound() const;

  const DressedBody& dressed_;
  const ClothMaterial material_;
  const ClothNet net_;
  Eigen::Matrix3Xd x_, before_, velocity_;  // (3, N) in world
  Eigen::Matrix3Xd skin_, normals_;         // (3, V) of the whole surface; (3, body) of the body
  std::vector<double> edge_force_, bend_force_;
  std::vector<Contact> contacts_;  // (N)
};

}  // namespace mvstudio::synth
