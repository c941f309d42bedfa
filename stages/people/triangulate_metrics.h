#pragma once

#include <array>
#include <map>
#include <utility>
#include <vector>

#include "core/status.h"
#include "stages/input/pose_input.h"
#include "triangulate/skeleton/refine.h"
#include "triangulate/take/limbs.h"
/// Metrics of `triangulate`.
namespace mvstudio::stages {

/// Figures over all points of a take, accumulated chunk by chunk.
class PointStatistics {
 public:
  PointStatistics(int num_joints, std::vector<std::pair<int, int>> limbs);
  void Add(const triangulate::TakeResult& take);
  void AddFrames(const std::vector<triangulate::DetectedFrame>& frames, const triangulate::TakeOptions& options);
  /// Warns of cameras that almost never see anybody.
  void WarnOfAbsence(const PoseInput& input, CommandResult* result) const;

  /// Warns of frames in which two cameras or more see more people than are kept.
  void WarnOfPersons(int max_persons, CommandResult* result) const;

  int num_ok() const { return static_cast<int>(rms_px_.size()); }
  int num_tried() const { return num_tried_; }
  /// Number of joints that enough cameras see for a point.
  int64_t num_carriable() const { return num_carriable_; }
  void AddTo(const geometry::Skeleton& skeleton, nlohmann::ordered_json* metrics) const;

  /// Too few points, or none: an error (exit 5 or 4), with the reason where the scores or the statuses are it. True when the
  /// reason is known.
  bool CheckLoss(const triangulate::TakeOptions& options, CommandResult* result) const;

 private:
  std::vector<std::pair<int, int>> limbs_;
  std::map<Status, int> counts_;
  std::vector<float> rms_px_, sigma_mm_;                           // of points with status kOk
  std::vector<std::vector<float>> joint_rms_px_, joint_sigma_mm_;  // the same by joint
  std::vector<triangulate::LimbLength> limb_lengths_;
  std::vector<int> frames_with_people_;                      // by camera
  int num_frames_ = 0, num_crowded_ = 0, most_persons_ = 0;  // frames with more people than are kept
  int num_lower_bounds_ = 0;  // points whose sigma holds the calibration's part of some of their cameras only
  int num_tried_ = 0, num_persons_ = 0;
  void CountScore(const triangulate::Keypoint& key);
  std::string ScoresText(double min_score) const;
  int Count(Status status) const;

  int64_t num_carriable_ = 0;
  int64_t num_unscored_ = 0;               // joints with coordinates and score 0
  std::array<int64_t, 1001> scores_ = {};  // detections by score, in thousandths
  double solve_s_ = 0;
};

/// Noise, method, held-out figures and the judgement of the cameras.
void AddTakeMetrics(const triangulate::TakeResult& take, const geometry::Skeleton& skeleton, nlohmann::ordered_json* metrics);

/// Terms that were tried, and their effect on limbs.
void AddRefinementMetrics(const triangulate::SkeletonRefineReport& report, nlohmann::ordered_json* metrics);

/// The terms in use and what they did, a line.
std::string RefinementText(const triangulate::SkeletonRefineReport& report);

/// Warns of cameras that are off or scaled, or that swap left and right.
void AddCameraWarnings(const triangulate::TakeResult& take, CommandResult* result);

/// Detections that scatter by a considerable part of the image, or that the other cameras do not predict, do not match this
/// calibration: exit 4.
void CheckConsistency(const triangulate::TakeResult& take, const geometry::Rig& rig, CommandResult* result);

}  // namespace mvstudio::stages
