#include "triangulate/tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace mvstudio::triangulate {
namespace {

/// Clusters of one person: frame index -> cluster index.
struct Track {
  std::map<size_t, size_t> clusters;
  int64_t support = 0;

  double MeanSupport() const {
    return static_cast<double>(support) / static_cast<double>(std::max<size_t>(clusters.size(), 1));
  }
};

/// Mean distance of the joints that both know, metres; infinity when there are none.
double MeanDistance(const Cluster& a, const Cluster& b) {
  double sum = 0;
  int count = 0;
  for (size_t j = 0; j < std::min(a.joints.size(), b.joints.size()); ++j) {
    if (!a.joints[j] || !b.joints[j]) continue;
    sum += (*a.joints[j] - *b.joints[j]).norm();
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
}

struct Link {
  double distance;
  size_t track, cluster;
};

std::vector<Link> PossibleLinks(const std::vector<TrackFrame>& frames, const std::vector<Track>& tracks, size_t f,
                                const AssociationOptions& options) {
  std::vector<Link> links;
  for (size_t t = 0; t < tracks.size(); ++t) {
    const auto& [last_f, last_cluster] = *tracks[t].clusters.rbegin();
    const int gap = frames[f].frame - frames[last_f].frame;
    if (gap > options.max_gap_frames) continue;
    for (size_t k = 0; k < frames[f].clusters.size(); ++k) {
      const double distance = MeanDistance(frames[last_f].clusters[last_cluster], frames[f].clusters[k]);
      if (distance <= options.max_step_m * std::sqrt(static_cast<double>(gap))) links.push_back({distance, t, k});
    }
  }
  std::sort(links.begin(), links.end(), [](const Link& a, const Link& b) { return a.distance < b.distance; });
  return links;
}

std::vector<Track> LinkTracks(const std::vector<TrackFrame>& frames, const AssociationOptions& options) {
  std::vector<Track> tracks;
  for (size_t f = 0; f < frames.size(); ++f) {
    std::vector<bool> track_taken(tracks.size(), false), cluster_taken(frames[f].clusters.size(), false);
    const auto extend = [&](Track& track, size_t k) {
      track.clusters[f] = k;
      track.support += frames[f].clusters[k].support;
      cluster_taken[k] = true;
    };
    for (const Link& link : PossibleLinks(frames, tracks, f, options)) {
      if (track_taken[link.track] || cluster_taken[link.cluster]) continue;
      track_taken[link.track] = true;
      extend(tracks[link.track], link.cluster);
    }
    for (size_t k = 0; k < frames[f].clusters.size(); ++k) {
      if (!cluster_taken[k]) extend(tracks.emplace_back(), k);
    }
  }
  std::stable_sort(tracks.begin(), tracks.end(), [](const Track& a, const Track& b) { return a.support > b.support; });
  return tracks;
}

bool Overlap(const Track& a, const Track& b) {
  return std::any_of(a.clusters.begin(), a.clusters.end(),
                     [&b](const auto& entry) { return b.clusters.count(entry.first) > 0; });
}

std::vector<Track> MergeTracks(const std::vector<Track>& tracks, size_t max_persons) {
  std::vector<Track> persons;
  for (const Track& track : tracks) {
    const auto continues = [&track](const Track& person) {
      return !Overlap(track, person) && track.MeanSupport() >= 0.5 * person.MeanSupport();
    };
    const auto person = std::find_if(persons.begin(), persons.end(), continues);
    if (person != persons.end()) {
      person->clusters.insert(track.clusters.begin(), track.clusters.end());
      person->support += track.support;
    } else if (persons.size() < max_persons) {
      persons.push_back(track);
    }
  }
  return persons;
}

}  // namespace

std::vector<std::vector<std::vector<int>>> FollowPersons(const std::vector<TrackFrame>& frames, size_t num_cameras,
                                                         const AssociationOptions& options) {
  const size_t max_persons = static_cast<size_t>(std::max(options.max_persons, 1));
  const std::vector<Track> persons = MergeTracks(LinkTracks(frames, options), max_persons);
  const size_t num_persons = std::max<size_t>(persons.size(), 1);
  const std::vector<int> nobody(num_cameras, -1);
  std::vector<std::vector<std::vector<int>>> assignment(frames.size(), std::vector<std::vector<int>>(num_persons, nobody));
  for (size_t p = 0; p < persons.size(); ++p) {
    for (const auto& [f, k] : persons[p].clusters) assignment[f][p] = frames[f].clusters[k].choice;
  }
  return assignment;
}

}  // namespace mvstudio::triangulate
