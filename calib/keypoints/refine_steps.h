// Private: the steps of RefineFromKeypoints, for refine*.cc.
#pragma once

#include <functional>

#include "calib/keypoints/refine.h"
#include "calib/keypoints/split.h"

namespace mvstudio::calib {

using Split = std::function<KeypointSplit(const std::vector<KeypointJoint>&)>;

/// The adjustment to the train frames of a split, in a world whose origin lies between the cameras.
class Refinement {
 public:
  /// All but `split` must outlive the refinement.
  Refinement(const geometry::Rig& given, const std::vector<triangulate::DetectedFrame>& frames,
             const KeypointRefineOptions& options, Split split, const RunContext& run);
  void Run();

  /// Report without held-out figures, cameras and covariances. Its rig is the input where the choice was to change
  /// nothing.
  const KeypointRefineReport& report() const { return report_; }
  const KeypointSplit& split() const { return split_; }
  const KeypointCovariance& covariance() const { return covariance_; }

 private:
  bool Fail(Status status, const std::string& message);
  bool AdjustPoses();
  KeypointSolution SolvePoses(const geometry::Rig& start, const KeypointFreedom& freedom) const;
  bool MeasureCovariance(const KeypointFreedom& freedom);
  bool AdjustAll();

  const geometry::Rig& given_;
  const std::vector<triangulate::DetectedFrame>& frames_;
  const KeypointRefineOptions& options_;
  Split make_split_;
  RunContext run_;
  int num_threads_;
  triangulate::AssociationOptions association_;
  KeypointSplit split_;
  std::vector<KeypointJoint> train_;  // of the split, limited
  KeypointSolution solution_;
  KeypointCovariance covariance_;
  KeypointRefineReport report_;
};

}  // namespace mvstudio::calib
