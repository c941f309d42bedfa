#include "stages/triangulate/point_statistics.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/statistics.h"
#include "stages/people/likely_cause.h"
#include "triangulate/take/cause.h"

namespace mvstudio::stages {
namespace {

/// People that two cameras see at once: the second largest number of detections.
int SeenByTwo(const triangulate::DetectedFrame& frame) {
  size_t first = 0, second = 0;
  for (const auto& people : frame.people) {
    if (people.size() > first) {
      second = first, first = people.size();
    } else {
      second = std::max(second, people.size());
    }
  }
  return static_cast<int>(second);
}

}  // namespace

PointStatistics::PointStatistics(int num_joints, std::vector<std::pair<int, int>> limbs)
    : limbs_(std::move(limbs)),
      joint_rms_px_(static_cast<size_t>(num_joints)),
      joint_sigma_mm_(static_cast<size_t>(num_joints)) {}

void PointStatistics::Add(const triangulate::TakeResult& take) {
  solve_s_ += take.solve_s;
  for (const triangulate::TakePoint& entry : take.points) {
    ++num_tried_;
    ++counts_[entry.point.status];
    if (entry.point.status != Status::kOk) continue;
    num_lower_bounds_ += entry.point.num_unknown_cameras > 0 && !entry.point.calibration_covariance.isZero(0);
    const float rms = static_cast<float>(entry.point.rms_px);
    const float sigma = static_cast<float>(1000 * std::sqrt(entry.point.covariance.trace() / 3));
    rms_px_.push_back(rms), sigma_mm_.push_back(sigma);
    joint_rms_px_[static_cast<size_t>(entry.joint_idx)].push_back(rms);
    joint_sigma_mm_[static_cast<size_t>(entry.joint_idx)].push_back(sigma);
  }
  limb_lengths_ = MergeLimbs(limb_lengths_, MeasureLimbs(take.points, limbs_));
  num_persons_ = std::max(num_persons_, take.num_persons);
}

void PointStatistics::AddFrames(const std::vector<triangulate::DetectedFrame>& frames,
                                const triangulate::TakeOptions& options) {
  num_frames_ += static_cast<int>(frames.size());
  for (const triangulate::DetectedFrame& frame : frames) {
    num_triangulable_ += NumTriangulable(frame, options.min_score, options.max_persons, options.min_views);
    frames_with_people_.resize(std::max(frames_with_people_.size(), frame.people.size()));
    for (size_t c = 0; c < frame.people.size(); ++c) {
      frames_with_people_[c] += !frame.people[c].empty();
      for (const triangulate::DetectedPerson& person : frame.people[c]) {
        for (const triangulate::Keypoint& key : person) CountScore(key);
      }
    }
    const int seen = SeenByTwo(frame);
    num_crowded_ += seen > options.max_persons;
    most_persons_ = std::max(most_persons_, seen);
  }
}

void PointStatistics::CountScore(const triangulate::Keypoint& key) {
  if (!key.px.allFinite()) return;
  if (key.score > 0) {
    ++scores_[static_cast<size_t>(std::min(key.score, 1.0) * 1000)];
  } else {
    num_unscored_ += !key.px.isZero(0);
  }
}

PointFigures PointStatistics::Figures(const geometry::Rig& rig, const std::vector<std::string>& cameras,
                                      const geometry::Skeleton& skeleton) const {
  PointFigures figures;
  figures.num_points = num_ok(), figures.num_tried = num_tried_, figures.num_lower_bounds = num_lower_bounds_;
  figures.num_triangulable = num_triangulable_, figures.num_persons = num_persons_;
  figures.status_counts = counts_;
  figures.mean_rms_px = Mean(rms_px_), figures.median_rms_px = LinearQuantile(rms_px_, 0.5);
  figures.points_per_s = num_tried_ / solve_s_;
  figures.median_sigma_mm = LinearQuantile(sigma_mm_, 0.5), figures.limb_std_mm = 1000 * MeanLimbStd(limb_lengths_);
  const auto name = [&](int joint) { return skeleton.joints[static_cast<size_t>(joint)]; };
  for (const triangulate::LimbLength& limb : limb_lengths_) {
    const auto [a, b] = limbs_[static_cast<size_t>(limb.limb)];
    figures.limbs.push_back({name(a) + "-" + name(b), limb});
  }
  for (size_t j = 0; j < skeleton.joints.size(); ++j) {
    figures.joints.push_back({skeleton.joints[j], joint_rms_px_[j].size(), LinearQuantile(joint_sigma_mm_[j], 0.5),
                              LinearQuantile(joint_rms_px_[j], 0.5)});
  }
  figures.num_frames = num_frames_, figures.num_crowded = num_crowded_, figures.most_persons = most_persons_;
  for (const std::string& camera : cameras) {
    const size_t c = static_cast<size_t>(rig.Find(camera));
    figures.frames_with_people.emplace_back(camera, c < frames_with_people_.size() ? frames_with_people_[c] : 0);
  }
  return figures;
}

void PointStatistics::CountScores(double min_score, Loss* loss) const {
  int64_t above = 0, below = 0;
  loss->num_unscored = num_unscored_;
  for (size_t i = 0; i < scores_.size(); ++i) {
    loss->num_scored += scores_[i];
    above += i + 1 > 1000 * min_score ? scores_[i] : 0;
  }
  loss->num_below = loss->num_scored - above;
  size_t bin = 0, q = 0;
  for (const double share : {0.1, 0.5, 0.9}) {
    const double wanted = share * static_cast<double>(loss->num_scored);
    while (bin + 1 < scores_.size() && static_cast<double>(below + scores_[bin]) < wanted) below += scores_[bin++];
    loss->score_quantiles[q++] = static_cast<double>(bin) / 1000;
  }
}

int PointStatistics::Count(Status status) const {
  const auto found = counts_.find(status);
  return found == counts_.end() ? 0 : found->second;
}

Loss PointStatistics::LossOf(const triangulate::TakeOptions& options) const {
  Loss loss;
  if (num_ok() > 0 && num_ok() >= kLostShare * static_cast<double>(num_triangulable_)) return loss;
  loss.kind = num_ok() == 0 ? Loss::Kind::kAll : Loss::Kind::kMost;
  CountScores(options.min_score, &loss);
  loss.num_endless = Count(Status::kNotConverged), loss.num_behind = Count(Status::kBehindCamera);
  const bool by_score = loss.num_scored > 0 ? loss.num_below > 0 : loss.num_unscored > 0;
  if (num_triangulable_ == 0) {
    loss.reason = by_score ? Loss::Reason::kScores : Loss::Reason::kNothingInCommon;
  } else if (2 * loss.num_endless > num_tried_) {
    loss.reason = Loss::Reason::kEndlessSearch;
  } else if (2 * loss.num_behind > num_tried_) {
    loss.reason = Loss::Reason::kBehind;
  }
  return loss;
}

}  // namespace mvstudio::stages
