#pragma once

#include <Eigen/SparseCore>
#include <optional>
#include <vector>

#include "avatar/body/fit/fit_body.h"
#include "avatar/body/fit/offsets.h"
#include "avatar/body/fit/pose_by_images.h"

namespace mvstudio::body {

/// A fit under way: the person's skeleton, offsets of its surface, a pose a time step.
class FitState {
 public:
  /// Lengths and joints of the skeleton by the joints of all time steps; poses by joints alone.
  FitState(const BodyTemplate& body, const std::vector<FitStep>& steps, const BodyFitOptions& options, const RunContext& run);

  /// The template with the offsets.
  BodyTemplate Shaped() const;
  /// One step of the offsets towards the outlines.
  Status FitShape(double laplacian_sigma_m, double max_px);
  /// One step of the template's shapes, where it has any.
  Status FitShapes(double max_px);
  bool HasShapes() const { return coefficients_.size() > 0; }
  /// Poses by joints and outlines.
  void FitPoses(double max_px);
  /// Poses by joints, outlines, and the brightness that a vertex has in the mean over all images. Gaussian of `sigma_px`.
  void FitBrightness(double sigma_px, double max_px);

  /// The body as it is, with a prior learned from the poses of the time steps in use.
  PersonBody Person() const;
  /// What vertices look like in the images in use.
  MeanBrightness Brightness(double sigma_px) const;
  /// (steps, views) which silhouettes take part.
  std::vector<std::vector<uint8_t>>* used() { return &used_; }
  bool IsUsed(int step, int view) const { return used_[step][view] != 0; }
  /// Held-out images join in.
  void UseAll();

  /// Whether the trunk of a time step is determined and an image of it takes part.
  bool IsFitted(int step) const;
  bool IsPosed(int step) const { return posed_[step] != 0; }
  const ArticulatedPose& pose(int step) const { return poses_[step]; }
  /// Of the surface along the rest normals, those of the shapes included.
  Eigen::VectorXd Offsets() const { return offsets_ + shape_offsets_ * coefficients_; }
  /// Standard deviations (V) of the surface along the rest normals, given the shapes; empty when unknown. The surface may be as
  /// rough as the softest that is tried, whichever was chosen: stiff ones are chosen for caution, not because people are like
  /// the template. Bones err by the sigma of the joints.
  Eigen::VectorXd OffsetSigma(double max_px) const;
  const Eigen::VectorXd& coefficients() const { return coefficients_; }
  double joint_sigma_m() const { return joint_sigma_m_; }
  double joint_error_m() const { return joint_error_m_; }
  bool HasPoses() const;

 private:
  void FitSkeleton();
  void PoseAllByJoints();
  /// (steps) where the surface should move along its normals.
  std::vector<std::vector<OffsetObservation>> MeasureSteps(double max_px) const;
  std::vector<OffsetObservation> MeasureShape(double max_px) const;
  MeanBrightness Brightness(const StepPoser& poser, double sigma_px) const;

  const std::vector<FitStep>* steps_;
  RunContext run_;
  BodyTemplate base_;  // the person's lengths, the template's surface
  RotationPrior prior_;
  double joint_sigma_m_, joint_error_m_ = 0;
  std::vector<ArticulatedPose> poses_;
  std::vector<uint8_t> posed_;              // the trunk is determined
  std::vector<std::vector<uint8_t>> used_;  // (steps, views) neither held out nor rejected
  Eigen::Matrix3Xf normals_;                // (3, V) of the rest pose
  Eigen::MatrixXd shape_offsets_;           // (V, S)
  Eigen::VectorXd coefficients_;            // (S)
  Eigen::VectorXd offsets_;                 // (V) beyond the shapes
  Eigen::SparseMatrix<double> laplacian_;
};

}  // namespace mvstudio::body
