#include "triangulate/take/stream.h"

#include <algorithm>
#include <limits>

#include "core/check.h"
#include "triangulate/people/assignment.h"

namespace mvstudio::triangulate {

TakeOptions SettleOptions(const geometry::Rig& rig, const std::vector<DetectedFrame>& sample, const TakeBody& body,
                          const TakeOptions& options, const RunContext& run, TakeResult* sample_result) {
  *sample_result = TriangulateTake(rig, sample, body, options, run);
  TakeOptions settled = options;
  settled.holdout_points = 0;
  settled.method = sample_result->method;
  settled.select_views |= options.method.IsAuto();
  if (sample_result->sigma_px > 0) settled.sigma_px = sample_result->sigma_px;
  return settled;
}

TakeStream::TakeStream(geometry::Rig rig, TakeBody body, TakeOptions options)
    : rig_(std::move(rig)), body_(std::move(body)), options_(std::move(options)) {}

TakeResult TakeStream::Push(const std::vector<DetectedFrame>& frames, const RunContext& run) {
  MVS_CHECK(frames.empty() || seam_.empty() || frames.front().frame > seam_.back().frame, "chunks must follow each other");
  std::vector<DetectedFrame> all = seam_;
  all.insert(all.end(), frames.begin(), frames.end());
  TakeResult result = TriangulateTake(rig_, all, body_, options_, run);
  const std::vector<int> numbers = NumberPersons(result);
  for (TakePoint& point : result.points) point.person = numbers[static_cast<size_t>(point.person)];
  const int last_old = seam_.empty() ? std::numeric_limits<int>::min() : seam_.back().frame;
  Remember(all, result);

  size_t kept = 0;
  for (size_t i = 0; i < result.points.size(); ++i) {
    if (result.points[i].frame <= last_old) continue;
    if (kept != i) {
      result.points[kept] = std::move(result.points[i]);
      result.observations[kept] = std::move(result.observations[i]);
    }
    ++kept;
  }
  result.points.resize(kept);
  result.observations.resize(kept);
  result.num_persons = next_person_;
  return result;
}

/// Lasting number of each person of the chunk: that of the known person nearest over the seam.
std::vector<int> TakeStream::NumberPersons(const TakeResult& result) {
  std::map<std::pair<int, int>, std::pair<double, int>> sums;  // (new, known) -> sum of distances, count
  for (const TakePoint& entry : result.points) {
    if (entry.point.status != Status::kOk) continue;
    for (auto known = seam_skeletons_.lower_bound({entry.frame, std::numeric_limits<int>::min()});
         known != seam_skeletons_.end() && known->first.first == entry.frame; ++known) {
      const auto joint = known->second.find(entry.joint_idx);
      if (joint == known->second.end()) continue;
      auto& [sum, count] = sums[{entry.person, known->first.second}];
      sum += (joint->second - entry.point.x_in_world).norm();
      ++count;
    }
  }
  // The nearer, the larger the gain; beyond the largest step there is none.
  const double farthest = AssociationOptions().max_step_m;
  Eigen::MatrixXd gain = Eigen::MatrixXd::Zero(result.num_persons, next_person_);
  for (const auto& [pair, sum] : sums) gain(pair.first, pair.second) = farthest - sum.first / sum.second;
  std::vector<int> numbers = BestAssignment(gain);
  for (int& number : numbers) {
    if (number < 0) number = options_.max_persons == 1 ? 0 : next_person_;
    next_person_ = std::max(next_person_, number + 1);
  }
  return numbers;
}

void TakeStream::Remember(const std::vector<DetectedFrame>& frames, const TakeResult& result) {
  const int gap = AssociationOptions().max_gap_frames;
  const int first = frames.empty() ? 0 : frames.back().frame - gap + 1;
  seam_.clear();
  seam_skeletons_.clear();
  for (const DetectedFrame& frame : frames) {
    if (frame.frame >= first) seam_.push_back(frame);
  }
  for (const TakePoint& entry : result.points) {
    if (entry.frame < first || entry.point.status != Status::kOk) continue;
    seam_skeletons_[{entry.frame, entry.person}][entry.joint_idx] = entry.point.x_in_world;
  }
}

}  // namespace mvstudio::triangulate
