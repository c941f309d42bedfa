// Private: for the association across views and the order of left and right.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "triangulate/people/association.h"

/// How well detected persons agree with each other, and with joints sketched from several of them.
namespace mvstudio::triangulate::internal {

/// A detected person with the rays of its joints, in local.
struct Candidate {
  int camera_idx = 0, person_idx = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // of the camera, metres
  double focal_px = 1;
  double limit_rad = 0;                // AssociationOptions::max_error_px
  std::vector<Eigen::Vector3d> rays;   // [joint] unit length
  std::vector<unsigned char> is_seen;  // [joint]
  int num_seen = 0;
};

std::vector<Candidate> MakeCandidates(const PreparedRig& rig, const DetectedFrame& frame, const AssociationOptions& options);

/// Evidence of one joint for (up to 1) or against (down to -1) two things being the same, from the squared distance in
/// sigmas over its 99.7 % limit. Zero at the limit and constant beyond sqrt(2) of it, so that one bad joint does not
/// outweigh many good ones.
inline double Evidence(double squared_over_limit) { return 1 - (squared_over_limit < 2 ? squared_over_limit : 2); }

/// Squared distance of two rays over its variance for an angular noise of `sigma_rad` (that of the two views, by focal
/// length); infinity when they meet behind a camera.
double SquaredRayDistance(const Candidate& a, const Candidate& b, size_t joint_a, size_t joint_b, double sigma_px);

/// Sum over the joints of the evidence that both show one person, from the distances of their rays. 0 with too few common
/// joints, minus infinity for two detections of one camera.
double PairEvidence(const Candidate& a, const Candidate& b, double sigma_px, const AssociationOptions& options);

/// Noise of the joints in px, calibration errors included, from the distances between rays of each detection and the best
/// fitting one in every other camera. 0 when there are no data.
double AssociationSigma(const std::vector<std::vector<Candidate>>& frames, const AssociationOptions& options);

/// Sums that determine the point nearest to a set of rays; single rays can be removed again.
struct RaySum {
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();  // sum of (I - r r^T)
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // sum of (I - r r^T) center
  int num_rays = 0;

  void Add(const Candidate& view, size_t joint, int sign);
};

/// A point from the rays of a cluster.
struct SketchPoint {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();       // metres, in local
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();  // covariance over (sigma_rad times distance)^2
};

/// Empty with fewer than two rays, or parallel ones.
std::optional<SketchPoint> Solve(const RaySum& sum);

/// Evidence that a ray of a view hits a point.
double PointEvidence(const Candidate& view, size_t joint, const SketchPoint& point, double sigma_px);

/// Evidence that two rays meet.
double RayEvidence(const Candidate& a, size_t joint_a, const Candidate& b, size_t joint_b, double sigma_px);

/// Evidence that a detection shows the person with these joints.
double SketchEvidence(const Candidate& view, const std::vector<std::optional<SketchPoint>>& sketch, double sigma_px,
                      const AssociationOptions& options, int* num_agreeing);

}  // namespace mvstudio::triangulate::internal
