#include "triangulate/sync/joint_tracks.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/statistics.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr int kMaxPersons = 8;
constexpr double kHalfWindow = 4.5;

/// Where a joint should be at sample `i` by its neighbours alone: median over the lines through one of the three samples before
/// and one of the three after, up to 6 frames apart. Nothing without at least two lines.
std::optional<Eigen::Vector2d> FromNeighbours(const JointTrack& track, size_t i) {
  constexpr int kMaxSpan = 6;
  std::vector<double> x, y;
  for (size_t a = i - std::min<size_t>(3, i); a < i; ++a) {
    for (size_t b = i + 1; b < std::min(i + 4, track.size()); ++b) {
      const double span = track[b].first - track[a].first;
      if (span > kMaxSpan) continue;
      const double t = (track[i].first - track[a].first) / span;
      const Eigen::Vector2d px = (1 - t) * track[a].second + t * track[b].second;
      x.push_back(px.x()), y.push_back(px.y());
    }
  }
  if (x.size() < 2) return std::nullopt;
  return Eigen::Vector2d(UpperMedian(std::move(x)), UpperMedian(std::move(y)));
}

/// Drops jumps: samples farther from what their neighbours say than 2 px and 5 times the median such distance of the track.
void DropJumps(JointTrack* track) {
  std::vector<double> distances(track->size(), 0), known;
  for (size_t i = 0; i < track->size(); ++i) {
    const auto expected = FromNeighbours(*track, i);
    if (!expected) continue;
    distances[i] = ((*track)[i].second - *expected).norm();
    known.push_back(distances[i]);
  }
  if (known.empty()) return;
  const double limit = 5 * UpperMedian(std::move(known)) + 2;
  JointTrack kept;
  for (size_t i = 0; i < track->size(); ++i) {
    if (distances[i] <= limit) kept.push_back((*track)[i]);
  }
  track->swap(kept);
}

}  // namespace

Tracks MakeTracks(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                  const std::vector<std::optional<int>>& start_frames, double min_score, const RunContext& run,
                  std::vector<int>* common_frames) {
  std::vector<double> offsets;
  for (const auto& each : start_frames) offsets.push_back(each ? *each : std::nan(""));
  const std::vector<DetectedFrame> shifted = ApplyOffsets(frames, offsets);
  AssociationOptions options;
  options.max_persons = kMaxPersons;
  options.min_score = min_score;
  RunContext quiet = run;
  quiet.progress = nullptr;
  const auto assignment = AssociateTake(rig, shifted, options, quiet);
  Tracks tracks(rig.cameras.size());
  for (size_t f = 0; f < shifted.size(); ++f) {
    common_frames->push_back(shifted[f].frame);
    for (size_t p = 0; p < assignment[f].size(); ++p) {
      for (size_t c = 0; c < assignment[f][p].size(); ++c) {
        if (assignment[f][p][c] < 0) continue;
        const DetectedPerson& person = shifted[f].people[c][static_cast<size_t>(assignment[f][p][c])];
        if (tracks[c].size() <= p) tracks[c].resize(p + 1);
        if (tracks[c][p].size() < person.size()) tracks[c][p].resize(person.size());
        for (size_t j = 0; j < person.size(); ++j) {
          if (!(person[j].score > 0) || person[j].score < min_score || !person[j].px.allFinite()) continue;
          tracks[c][p][j].emplace_back(shifted[f].frame + *start_frames[c], person[j].px);
        }
      }
    }
  }
  for (auto& camera : tracks) {
    for (auto& person : camera) {
      for (JointTrack& track : person) DropJumps(&track);
    }
  }
  return tracks;
}

std::optional<TrackSample> SampleTrack(const JointTrack& track, double frame) {
  const auto first = std::lower_bound(track.begin(), track.end(), frame - kHalfWindow,
                                      [](const auto& sample, double at) { return sample.first < at; });
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
  int count = 0;
  bool before = false, after = false;
  for (auto it = first; it != track.end() && it->first <= frame + kHalfWindow; ++it) {
    const double t = it->first - frame, weight = std::pow(1 - t * t / (kHalfWindow * kHalfWindow), 3);
    const Eigen::Vector3d basis(1, t, t * t);
    moments += weight * basis * basis.transpose();
    right += weight * basis * it->second.transpose();
    before |= t <= 0 && t > -2, after |= t >= 0 && t < 2;
    ++count;
  }
  if (count < 5 || !before || !after) return std::nullopt;
  const Eigen::Matrix<double, 3, 2> fit = moments.ldlt().solve(right);
  return TrackSample{fit.row(0).transpose(), fit.row(1).transpose()};
}

bool HasNeighbours(const JointTrack& track, int frame) {
  constexpr int kFarthest = 3;
  const auto within = [&](int first, int last) {
    const auto found =
        std::lower_bound(track.begin(), track.end(), first, [](const auto& sample, int at) { return sample.first < at; });
    return found != track.end() && found->first <= last;
  };
  return within(frame - kFarthest, frame - 1) && within(frame + 1, frame + kFarthest);
}

}  // namespace mvstudio::triangulate::internal
