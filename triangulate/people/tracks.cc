#include "triangulate/people/tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/statistics.h"
#include "triangulate/people/assignment.h"
#include "triangulate/people/ghosts.h"

namespace mvstudio::triangulate {
namespace {

using Joints = std::vector<std::optional<Eigen::Vector3d>>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Clusters of one person: frame index -> cluster index.
struct Track {
  std::map<size_t, size_t> clusters;
  int64_t support = 0;

  double MeanSupport() const {
    return static_cast<double>(support) / static_cast<double>(std::max<size_t>(clusters.size(), 1));
  }
};

const Joints& JointsOf(const std::vector<TrackFrame>& frames, const std::pair<const size_t, size_t>& entry) {
  return frames[entry.first].clusters[entry.second].joints;
}

/// Median distance of the joints that both know, metres; infinity when there are none.
double MedianDistance(const Joints& a, const Joints& b, const Eigen::Vector3d& b_moved_by) {
  std::vector<double> distances;
  for (size_t j = 0; j < std::min(a.size(), b.size()); ++j) {
    if (a[j] && b[j]) distances.push_back((*b[j] + b_moved_by - *a[j]).norm());
  }
  return UpperMedian(std::move(distances), kInfinity);
}

/// Median displacement of the joints that both know, metres.
Eigen::Vector3d MedianStep(const Joints& from, const Joints& to) {
  Eigen::Vector3d step = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (size_t j = 0; j < std::min(from.size(), to.size()); ++j) {
      if (from[j] && to[j]) values.push_back((*to[j] - *from[j])[axis]);
    }
    step[axis] = UpperMedian(std::move(values), 0);
  }
  return step;
}

/// Metres a frame, over the last five frames of the track; zero when it has not been seen in them.
Eigen::Vector3d Velocity(const std::vector<TrackFrame>& frames, const Track& track) {
  constexpr int kSpan = 5;
  const auto last = track.clusters.rbegin();
  auto first = last;
  for (auto it = std::next(last); it != track.clusters.rend(); ++it) {
    if (frames[last->first].frame - frames[it->first].frame > kSpan) break;
    first = it;
  }
  const int span = frames[last->first].frame - frames[first->first].frame;
  if (span == 0) return Eigen::Vector3d::Zero();
  return MedianStep(JointsOf(frames, *first), JointsOf(frames, *last)) / span;
}

/// Numbers of the tracks that may go on in frame f.
std::vector<size_t> LiveTracks(const std::vector<TrackFrame>& frames, const std::vector<Track>& tracks, size_t f,
                               const AssociationOptions& options) {
  std::vector<size_t> live;
  for (size_t t = 0; t < tracks.size(); ++t) {
    if (frames[f].frame - frames[tracks[t].clusters.rbegin()->first].frame <= options.max_gap_frames) live.push_back(t);
  }
  return live;
}

/// (live tracks, clusters of the frame)
Eigen::MatrixXd LinkGains(const std::vector<TrackFrame>& frames, const std::vector<Track>& tracks,
                          const std::vector<size_t>& live, size_t f, const AssociationOptions& options) {
  const std::vector<Cluster>& clusters = frames[f].clusters;
  Eigen::MatrixXd gain(static_cast<Eigen::Index>(live.size()), static_cast<Eigen::Index>(clusters.size()));
  for (Eigen::Index t = 0; t < gain.rows(); ++t) {
    const Track& track = tracks[live[static_cast<size_t>(t)]];
    const auto& last = *track.clusters.rbegin();
    const int gap = frames[f].frame - frames[last.first].frame;
    const Eigen::Vector3d moved = Velocity(frames, track) * gap;
    const double gate = options.max_step_m * std::sqrt(static_cast<double>(gap));
    for (Eigen::Index k = 0; k < gain.cols(); ++k) {
      gain(t, k) = 1 - MedianDistance(clusters[static_cast<size_t>(k)].joints, JointsOf(frames, last), moved) / gate;
    }
  }
  return gain;
}

std::vector<Track> LinkTracks(const std::vector<TrackFrame>& frames, const AssociationOptions& options) {
  std::vector<Track> tracks;
  for (size_t f = 0; f < frames.size(); ++f) {
    std::vector<bool> taken(frames[f].clusters.size(), false);
    const auto extend = [&](Track& track, size_t k) {
      track.clusters[f] = k;
      track.support += frames[f].clusters[k].support;
      taken[k] = true;
    };
    const std::vector<size_t> live = LiveTracks(frames, tracks, f, options);
    const std::vector<int> choice = BestAssignment(LinkGains(frames, tracks, live, f, options));
    for (size_t t = 0; t < choice.size(); ++t) {
      if (choice[t] >= 0) extend(tracks[live[t]], static_cast<size_t>(choice[t]));
    }
    for (size_t k = 0; k < taken.size(); ++k) {
      if (!taken[k]) extend(tracks.emplace_back(), k);
    }
  }
  std::stable_sort(tracks.begin(), tracks.end(), [](const Track& a, const Track& b) { return a.support > b.support; });
  return tracks;
}

std::vector<Track> WithoutGhosts(const PreparedRig& rig, const std::vector<TrackFrame>& frames,
                                 const std::vector<Track>& tracks, TakeAssociation* result) {
  std::vector<TrackSupport> supports;
  for (const Track& track : tracks) {
    TrackSupport& support = supports.emplace_back();
    support.num_frames = static_cast<int>(track.clusters.size());
    for (const auto& [f, k] : track.clusters) {
      const Cluster& cluster = frames[f].clusters[k];
      const auto views = std::count_if(cluster.choice.begin(), cluster.choice.end(), [](int p) { return p >= 0; });
      support.num_views += static_cast<double>(views) / support.num_frames;
      support.num_chances += static_cast<double>(CountChances(rig, cluster)) / support.num_frames;
    }
  }
  const std::vector<bool> is_ghost = FindGhosts(supports, static_cast<int>(frames.size()));
  std::vector<Track> real;
  for (size_t t = 0; t < tracks.size(); ++t) {
    if (!is_ghost[t]) real.push_back(tracks[t]);
    result->num_ghosts += is_ghost[t];
    result->num_ghost_frames += is_ghost[t] ? supports[t].num_frames : 0;
  }
  return real;
}

bool Overlap(const Track& a, const Track& b) {
  return std::any_of(a.clusters.begin(), a.clusters.end(),
                     [&b](const auto& entry) { return b.clusters.count(entry.first) > 0; });
}

/// Speed that someone needs to be both, metres a frame: the largest between appearances that follow each other.
double SpeedBetween(const std::vector<TrackFrame>& frames, const Track& a, const Track& b) {
  std::map<size_t, std::pair<const Track*, const Joints*>> both;
  for (const Track* track : {&a, &b}) {
    for (const auto& entry : track->clusters) both[entry.first] = {track, &JointsOf(frames, entry)};
  }
  double speed = 0;
  for (auto next = both.begin(), it = next++; next != both.end(); it = next++) {
    if (it->second.first == next->second.first) continue;
    const double distance = MedianDistance(*it->second.second, *next->second.second, Eigen::Vector3d::Zero());
    speed = std::max(speed, distance / (frames[next->first].frame - frames[it->first].frame));
  }
  return speed;
}

std::vector<Track> MergeTracks(const std::vector<TrackFrame>& frames, const std::vector<Track>& tracks,
                               const AssociationOptions& options) {
  const size_t max_persons = static_cast<size_t>(std::max(options.max_persons, 1));
  std::vector<Track> persons;
  for (const Track& track : tracks) {
    Track* nearest = nullptr;
    Track* any = nullptr;
    double least = options.max_step_m;
    for (Track& person : persons) {
      if (Overlap(track, person) || track.MeanSupport() < 0.5 * person.MeanSupport()) continue;
      if (!any) any = &person;
      const double speed = SpeedBetween(frames, track, person);
      if (speed <= least) nearest = &person, least = speed;
    }
    const bool is_full = persons.size() >= max_persons;
    Track* const same = nearest ? nearest : is_full ? any : nullptr;
    if (same) {
      same->clusters.insert(track.clusters.begin(), track.clusters.end());
      same->support += track.support;
    } else if (!is_full) {
      persons.push_back(track);
    }
  }
  return persons;
}

}  // namespace

TakeAssociation FollowPersons(const PreparedRig& rig, const std::vector<TrackFrame>& frames,
                              const AssociationOptions& options) {
  TakeAssociation result;
  const std::vector<Track> tracks = WithoutGhosts(rig, frames, LinkTracks(frames, options), &result);
  const std::vector<Track> persons = MergeTracks(frames, tracks, options);
  const size_t num_persons = std::max<size_t>(persons.size(), 1);
  const std::vector<int> nobody(rig.cameras.size(), -1);
  result.assignment.assign(frames.size(), std::vector<std::vector<int>>(num_persons, nobody));
  for (size_t p = 0; p < persons.size(); ++p) {
    for (const auto& [f, k] : persons[p].clusters) result.assignment[f][p] = frames[f].clusters[k].choice;
  }
  return result;
}

}  // namespace mvstudio::triangulate
