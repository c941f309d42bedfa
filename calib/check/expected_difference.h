#pragma once

#include <cstdint>
#include <vector>

#include "calib/check/rig_compare.h"
#include "geometry/rig/rig.h"

/// How large the difference of two calibrations of one rig may be by the covariances that both state: what is larger is a
/// change, or an error that the covariances do not know.
namespace mvstudio::calib {

/// Root of the expected mean square of ProjectionDiffAtRange's rms_px, for each range: J (S_camera + S_reference) J^T to
/// first order, with what the implied motion takes out projected out. NaN where a lens states no covariance.
std::vector<double> ExpectedProjectionRms(const geometry::RigCamera& camera, const geometry::RigCamera& reference,
                                          const ProjectionDiffOptions& options = {});

/// A camera's pose in two rigs, after the rigid motion between their worlds.
struct PoseDifference {
  double rotation_rad = 0, translation_m = 0;
};

/// Of each camera of `reference`, in its order; both rigs have the same names.
std::vector<PoseDifference> PoseDifferences(const geometry::Rig& rig, const geometry::Rig& reference,
                                            const geometry::Rigid3& reference_from_rig);

/// Root mean squares of PoseDifferences over rigs drawn from both covariances and aligned as CompareRigs does, seeded. NaN
/// where one of the poses has no covariance, for all cameras: the alignment needs them all.
std::vector<PoseDifference> ExpectedPoseDifferences(const geometry::Rig& rig, const geometry::Rig& reference,
                                                    uint64_t seed = 0);

}  // namespace mvstudio::calib
