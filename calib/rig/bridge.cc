#include "calib/rig/bridge.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>

#include "calib/rig/hand_eye.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

/// Pose of a group of boards in a group of cameras, per frame (index into the posed views).
struct Track {
  int cameras = 0, boards = 0;  // groups
  std::map<int, Rigid3> cameras_from_boards;
};

/// Of the views' opinions the one that agrees best with all.
Rigid3 BestOpinion(const std::vector<const PosedView*>& observations, const PosedGroups& cameras, const PosedGroups& boards) {
  Rigid3 best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const PosedView* observation : observations) {
    const Rigid3 opinion =
        geometry::Inverse(cameras.poses[observation->camera]) * observation->cam_from_board * boards.poses[observation->board];
    double cost = 0;
    for (const PosedView* other : observations) {
      cost += MarksMoved(*other, cameras.poses[other->camera] * opinion * geometry::Inverse(boards.poses[other->board]));
    }
    if (cost < best_cost) best_cost = cost, best = opinion;
  }
  return best;
}

std::vector<Track> CollectTracks(const std::vector<PosedViews>& frames, const PosedGroups& cameras, const PosedGroups& boards) {
  std::map<std::pair<int, int>, Track> tracks;
  for (size_t f = 0; f < frames.size(); ++f) {
    std::map<std::pair<int, int>, std::vector<const PosedView*>> of_groups;
    for (const PosedView& observation : frames[f]) {
      of_groups[{cameras.group_of[observation.camera], boards.group_of[observation.board]}].push_back(&observation);
    }
    for (const auto& [groups, observations] : of_groups) {
      Track& track = tracks[groups];
      track.cameras = groups.first, track.boards = groups.second;
      track.cameras_from_boards[static_cast<int>(f)] = BestOpinion(observations, cameras, boards);
    }
  }
  std::vector<Track> list;
  for (auto& [groups, track] : tracks) list.push_back(std::move(track));
  return list;
}

std::vector<HandEyePair> CommonFrames(const Track& a, const Track& b) {
  std::vector<HandEyePair> pairs;
  for (const auto& [frame, pose] : a.cameras_from_boards) {
    const auto other = b.cameras_from_boards.find(frame);
    if (other != b.cameras_from_boards.end()) pairs.push_back({pose, other->second});
  }
  constexpr size_t kMaxPairs = 150;
  if (pairs.size() <= kMaxPairs) return pairs;
  std::vector<HandEyePair> some;
  for (size_t i = 0; i < kMaxPairs; ++i) some.push_back(pairs[i * pairs.size() / kMaxPairs]);
  return some;
}

struct Candidate {
  const Track *a = nullptr, *b = nullptr;
  HandEye hand_eye;
  Eigen::Vector3d anchor_in_b;  // mean place of the boards in the second group of cameras
};

std::vector<Candidate> SolvePairs(const std::vector<Track>& tracks, std::vector<RefusedBridge>* refused) {
  std::vector<Candidate> candidates;
  for (size_t i = 0; i < tracks.size(); ++i) {
    for (size_t j = i + 1; j < tracks.size(); ++j) {
      if (tracks[i].cameras == tracks[j].cameras || tracks[i].boards == tracks[j].boards) continue;
      const std::vector<HandEyePair> pairs = CommonFrames(tracks[i], tracks[j]);
      if (pairs.empty()) continue;
      Candidate candidate{&tracks[i], &tracks[j], SolveHandEye(pairs), Eigen::Vector3d::Zero()};
      if (candidate.hand_eye.status != Status::kOk) {
        refused->push_back({tracks[i].cameras, tracks[j].cameras, static_cast<int>(pairs.size()), candidate.hand_eye.message});
        continue;
      }
      for (const HandEyePair& pair : pairs) {
        candidate.anchor_in_b += pair.b_from_q.translation / static_cast<double>(pairs.size());
      }
      candidates.push_back(candidate);
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.hand_eye.a_from_b_sigma.head<3>().norm() < b.hand_eye.a_from_b_sigma.head<3>().norm();
  });
  return candidates;
}

PoseLink LinkGroups(const PosedGroups& nodes, int group_a, int group_b, const Rigid3& a_from_b,
                    const Eigen::Vector3d& anchor_in_b, double weight) {
  const int a = nodes.groups[group_a].front(), b = nodes.groups[group_b].front();
  return {a, b, nodes.poses[a] * a_from_b * geometry::Inverse(nodes.poses[b]), nodes.poses[b] * anchor_in_b, weight};
}

}  // namespace

Bridges FindBridges(const std::vector<PosedViews>& frames, const PosedGroups& cameras, const PosedGroups& boards) {
  Bridges bridges;
  if (cameras.groups.size() < 2 || boards.groups.size() < 2) return bridges;
  const std::vector<Track> tracks = CollectTracks(frames, cameras, boards);
  std::vector<bool> camera_used(cameras.groups.size(), false), board_used(boards.groups.size(), false);
  for (const Candidate& c : SolvePairs(tracks, &bridges.refused)) {
    if (camera_used[c.a->cameras] || camera_used[c.b->cameras] || board_used[c.a->boards] || board_used[c.b->boards]) continue;
    camera_used[c.a->cameras] = camera_used[c.b->cameras] = board_used[c.a->boards] = board_used[c.b->boards] = true;
    const double weight = c.hand_eye.num_inliers;
    bridges.cameras.push_back(LinkGroups(cameras, c.a->cameras, c.b->cameras, c.hand_eye.a_from_b, c.anchor_in_b, weight));
    bridges.boards.push_back(
        LinkGroups(boards, c.b->boards, c.a->boards, c.hand_eye.q_from_p, Eigen::Vector3d::Zero(), weight));
  }
  return bridges;
}

}  // namespace mvstudio::calib
