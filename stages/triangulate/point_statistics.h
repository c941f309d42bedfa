#pragma once

#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/status.h"
#include "stages/input/pose_input.h"
#include "triangulate/take/limbs.h"
#include "triangulate/take/take.h"

/// Figures over all points of a take.
namespace mvstudio::stages {

struct PointFigures {
  int num_points = 0;            ///< with status kOk
  int num_tried = 0;             ///< joints
  int num_lower_bounds = 0;      ///< points whose sigma holds the calibration's part of some of their cameras only
  int64_t num_triangulable = 0;  ///< joints that enough cameras see for a point
  int num_persons = 0;
  std::map<Status, int> status_counts;
  double mean_rms_px = 0, median_rms_px = 0, median_sigma_mm = 0, limb_std_mm = 0;  ///< NaN without points
  double points_per_s = 0;
  struct Limb {
    std::string name;
    triangulate::LimbLength length;
  };
  std::vector<Limb> limbs;
  struct Joint {
    std::string name;
    size_t num = 0;
    double sigma_mm = 0, rms_px = 0;  ///< medians
  };
  std::vector<Joint> joints;  ///< all of the skeleton
  int num_frames = 0;
  std::vector<std::pair<std::string, int>> frames_with_people;  ///< by camera that has 2D joints
  int num_crowded = 0, most_persons = 0;                        ///< frames in which two cameras see more people than are kept
};

/// How many points are missing, and why where the scores or the statuses say it.
struct Loss {
  enum class Kind { kNone, kMost, kAll };
  enum class Reason { kUnknown, kScores, kNothingInCommon, kEndlessSearch, kBehind };
  Kind kind = Kind::kNone;
  Reason reason = Reason::kUnknown;
  int64_t num_scored = 0, num_below = 0;       ///< detections with a score, and those below the least score
  int64_t num_unscored = 0;                    ///< joints with coordinates and score 0
  std::array<double, 3> score_quantiles = {};  ///< 10, 50, 90 %
  int num_endless = 0;                         ///< points whose search does not end
  int num_behind = 0;                          ///< points that would lie behind a camera
};

/// Accumulates them chunk by chunk.
class PointStatistics {
 public:
  PointStatistics(int num_joints, std::vector<std::pair<int, int>> limbs);
  void Add(const triangulate::TakeResult& take);
  void AddFrames(const std::vector<triangulate::DetectedFrame>& frames, const triangulate::TakeOptions& options);

  int num_ok() const { return static_cast<int>(rms_px_.size()); }
  /// `cameras`: those with 2D joints.
  PointFigures Figures(const geometry::Rig& rig, const std::vector<std::string>& cameras,
                       const geometry::Skeleton& skeleton) const;
  Loss LossOf(const triangulate::TakeOptions& options) const;

 private:
  void CountScore(const triangulate::Keypoint& key);
  void CountScores(double min_score, Loss* loss) const;
  int Count(Status status) const;

  std::vector<std::pair<int, int>> limbs_;
  std::map<Status, int> counts_;
  std::vector<float> rms_px_, sigma_mm_;                           // of points with status kOk
  std::vector<std::vector<float>> joint_rms_px_, joint_sigma_mm_;  // the same by joint
  std::vector<triangulate::LimbLength> limb_lengths_;
  std::vector<int> frames_with_people_;                      // by camera
  int num_frames_ = 0, num_crowded_ = 0, most_persons_ = 0;  // frames with more people than are kept
  int num_lower_bounds_ = 0;
  int num_tried_ = 0, num_persons_ = 0;
  int64_t num_triangulable_ = 0;
  int64_t num_unscored_ = 0;
  std::array<int64_t, 1001> scores_ = {};  // detections by score, in thousandths
  double solve_s_ = 0;
};

}  // namespace mvstudio::stages
