#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/keypoints/take.h"
#include "core/status.h"
#include "geometry/rig/rig.h"
#include "triangulate/people/association.h"

/// Cameras with known lenses, placed by people alone.
namespace mvstudio::calib {

/// A length that is known, as the mean of the parts' medians over the take.
struct KnownLength {
  std::pair<int, int> joints;  ///< indices into the skeleton
  double length_m = 0;
};

struct PlacedRig {
  Status status = Status::kOk;  ///< kTooFewViews, kDegenerate: `message` says which camera and why
  std::string message;
  geometry::Rig rig;         ///< in the axes of its first camera; metres by the known lengths
  double inlier_share = 0;   ///< of the pair that the rig was built from: joints that fit its relative pose
  double length_spread = 0;  ///< standard deviation of the factors that the lengths ask for, as a share of their mean
};

/// Poses of cameras whose lenses are known, from what they see of a person at once. In every image the largest person counts.
///
/// The pair of cameras with the most joints that fit one relative pose, times the sine of their parallax, comes first: five
/// points (Nister, PAMI 2004) within random sample consensus, by OpenGV. The other cameras are placed by the joints that
/// those before them triangulate (ResectFromPoints). The known lengths give the scale.
///
/// A start for RefineFromKeypoints: accurate to a few degrees and per cent. `frames` hold one list of people per camera of
/// `lenses`; their poses are not read. The result does not depend on the number of threads.
PlacedRig PlaceFromKeypoints(const geometry::Rig& lenses, const std::vector<triangulate::DetectedFrame>& frames,
                             const std::vector<KnownLength>& lengths, double min_score);

/// Further starts for cameras of known lenses whose given poses are far off, from joints that are told apart already. Size and
/// frame are arbitrary. Empty where they cannot be found.
///
/// All cameras anew, as PlaceFromKeypoints does it.
std::optional<geometry::Rig> PlaceAnew(const geometry::Rig& lenses, const std::vector<KeypointJoint>& joints);
/// The cameras of `wrong`, the first first, by the points of the others, which keep their poses.
std::optional<geometry::Rig> PlaceByOthers(const geometry::Rig& rig, const std::vector<KeypointJoint>& joints,
                                           const std::vector<size_t>& wrong);

}  // namespace mvstudio::calib
