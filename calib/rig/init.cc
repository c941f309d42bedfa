#include "calib/rig/init.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "calib/rig/bridge.h"
#include "calib/rig/links.h"
#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;
using geometry::Rigid3;

/// The cameras are numbered by the order of their names ("rank"), so that the caller's order plays no part.
struct Problem {
  std::vector<int> rank;       // per camera
  std::vector<int> camera_of;  // per rank
  KnownPoses known;            // per rank; empty without any
  std::vector<PosedViews> frames;
  int num_cameras = 0, num_boards = 0;
};

struct Assembly {
  PosedGroups cameras, boards;
  std::vector<PoseLink> camera_links, board_links;
  std::vector<RefusedBridge> refused;
};

void CheckArguments(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board, int reference,
                    const RigState& state, const RigInitOptions& options) {
  const auto cameras = static_cast<int>(state.cameras.size());
  MVS_CHECK(cameras > 0, "no cameras");
  MVS_CHECK(reference >= 0 && reference < cameras, "reference camera " << reference << " of " << cameras);
  MVS_CHECK(views.size() == cam_from_board.size(), views.size() << " views, " << cam_from_board.size() << " poses");
  MVS_CHECK(options.known_cam_from_world.empty() || static_cast<int>(options.known_cam_from_world.size()) == cameras,
            options.known_cam_from_world.size() << " known poses for " << cameras << " cameras");
  for (const View& view : views) {
    MVS_CHECK(view.camera_idx >= 0 && view.camera_idx < cameras, "view of camera " << view.camera_idx);
    MVS_CHECK(view.board >= 0 && view.board < static_cast<int>(state.rig_from_board.size()), "view of board " << view.board);
    MVS_CHECK(view.frame >= 0 && view.frame < static_cast<int>(state.frames.size()), "view of frame " << view.frame);
  }
}

Problem MakeProblem(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board, const RigState& state,
                    const RigInitOptions& options) {
  Problem problem;
  problem.num_cameras = static_cast<int>(state.cameras.size());
  problem.num_boards = static_cast<int>(state.rig_from_board.size());
  problem.camera_of.resize(problem.num_cameras);
  std::iota(problem.camera_of.begin(), problem.camera_of.end(), 0);
  std::stable_sort(problem.camera_of.begin(), problem.camera_of.end(),
                   [&](int a, int b) { return state.cameras[a].name < state.cameras[b].name; });
  problem.rank.resize(problem.num_cameras);
  const auto& known = options.known_cam_from_world;
  if (std::any_of(known.begin(), known.end(), [](const auto& pose) { return pose.has_value(); })) {
    problem.known.resize(problem.num_cameras);
  }
  for (int r = 0; r < problem.num_cameras; ++r) {
    problem.rank[problem.camera_of[r]] = r;
    if (!problem.known.empty()) problem.known[r] = known[problem.camera_of[r]];
  }
  problem.frames = CollectPosedViews(views, cam_from_board, problem.rank);
  return problem;
}

/// Groups of cameras and of boards grow until neither links more of the other and no bridge is left.
Assembly Assemble(const Problem& problem) {
  Assembly result;
  std::vector<PoseLink> camera_bridges, board_bridges;
  result.boards = SingleNodes(problem.num_boards);
  for (;;) {
    const auto boards_before = result.boards.groups;
    result.camera_links = LinkCameras(problem.frames, result.boards);
    result.camera_links.insert(result.camera_links.end(), camera_bridges.begin(), camera_bridges.end());
    result.cameras = PoseByLinks(problem.num_cameras, result.camera_links, problem.known, true);
    result.board_links = LinkBoards(problem.frames, result.cameras);
    result.board_links.insert(result.board_links.end(), board_bridges.begin(), board_bridges.end());
    result.boards = PoseByLinks(problem.num_boards, result.board_links, {}, true);
    if (result.boards.groups != boards_before) continue;
    const Bridges bridges = FindBridges(problem.frames, result.cameras, result.boards);
    result.refused = bridges.refused;
    if (bridges.cameras.empty()) return result;
    camera_bridges.insert(camera_bridges.end(), bridges.cameras.begin(), bridges.cameras.end());
    board_bridges.insert(board_bridges.end(), bridges.boards.begin(), bridges.boards.end());
    result.board_links.insert(result.board_links.end(), bridges.boards.begin(), bridges.boards.end());
    result.boards = PoseByLinks(problem.num_boards, result.board_links, {}, true);
  }
}

/// A distance in px up to which a corner counts in full.
constexpr double kCapPx = 100;

double CappedError(const PosedView& observation, const RigState& state, const Rigid3& cam_from_board) {
  const auto residuals = ResidualsOf(*observation.view, state.cameras[observation.view->camera_idx], cam_from_board);
  if (!residuals) return kCapPx * static_cast<double>(observation.view->size());
  return residuals->colwise().norm().cwiseMin(kCapPx).sum();
}

/// Pose of the boards of one frame from the view that agrees best with all: by the boards' marks, then by their corners.
Rigid3 PlaceFrame(const PosedViews& frame, const RigState& state) {
  constexpr size_t kBest = 4;
  constexpr double kCapMoved = 0.2;
  const auto cam_from_board = [&](const PosedView& observation, const Rigid3& world_from_rig) {
    return state.cam_from_world[observation.view->camera_idx] * world_from_rig * state.rig_from_board[observation.board];
  };
  std::vector<std::pair<double, Rigid3>> opinions;
  for (const PosedView& observation : frame) {
    const Rigid3 opinion = geometry::Inverse(state.cam_from_world[observation.view->camera_idx]) * observation.cam_from_board *
                           geometry::Inverse(state.rig_from_board[observation.board]);
    double moved = 0;
    for (const PosedView& other : frame) moved += std::min(kCapMoved, MarksMoved(other, cam_from_board(other, opinion)));
    opinions.emplace_back(moved, opinion);
  }
  std::stable_sort(opinions.begin(), opinions.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  opinions.resize(std::min(opinions.size(), kBest));
  Rigid3 best = opinions.front().second;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const auto& [moved, opinion] : opinions) {
    double cost = 0;
    for (const PosedView& observation : frame) cost += CappedError(observation, state, cam_from_board(observation, opinion));
    if (cost < best_cost) best_cost = cost, best = opinion;
  }
  return best;
}

/// Poses of `state` from those of the nodes: world is that of the known cameras or of the reference, and the first board of
/// each group has the identity.
void Place(const Problem& problem, const PosedGroups& cameras, const PosedGroups& boards, int reference, RigState* state) {
  state->cam_from_world.assign(problem.num_cameras, Rigid3());
  const Rigid3 group_from_world = problem.known.empty() ? geometry::Inverse(cameras.poses[problem.rank[reference]]) : Rigid3();
  for (int r = 0; r < problem.num_cameras; ++r) {
    const int camera = problem.camera_of[r];
    state->cam_from_world[camera] = cameras.poses[r] * group_from_world;
    if (!problem.known.empty() && problem.known[r]) state->cam_from_world[camera] = *problem.known[r];
  }
  if (problem.known.empty()) state->cam_from_world[reference] = Rigid3();
  for (const std::vector<int>& group : boards.groups) {
    for (int b : group) state->rig_from_board[b] = boards.poses[group.front()] * geometry::Inverse(boards.poses[b]);
    state->rig_from_board[group.front()] = Rigid3();
  }
  state->world_from_board.assign(state->frames.size(), Rigid3());
  for (const PosedViews& frame : problem.frames) state->world_from_board[frame.front().frame] = PlaceFrame(frame, *state);
}

/// Mean capped and median distance of the corners, px.
std::pair<double, double> Explains(const Problem& problem, const RigState& state) {
  std::vector<double> distances;
  double sum = 0;
  for (const PosedViews& frame : problem.frames) {
    for (const PosedView& observation : frame) {
      const View& view = *observation.view;
      const auto residuals = ResidualsOf(view, state.cameras[view.camera_idx], CamFromBoard(view, state));
      for (Index i = 0; i < view.size(); ++i) {
        if (view.weights[i] <= 0) continue;
        distances.push_back(residuals ? residuals->col(i).norm() : std::numeric_limits<double>::infinity());
        sum += std::min(kCapPx, distances.back());
      }
    }
  }
  return {sum / static_cast<double>(distances.size()), UpperMedian(distances)};
}

/// Averaged or chained poses, whichever explains the corners better.
void Choose(const Problem& problem, const Assembly& assembly, int reference, RigState* state, RigStart* start) {
  RigState chained = *state;
  Place(problem, assembly.cameras, assembly.boards, reference, state);
  Place(problem, PoseByLinks(problem.num_cameras, assembly.camera_links, problem.known, false),
        PoseByLinks(problem.num_boards, assembly.board_links, {}, false), reference, &chained);
  const auto [averaged_mean, averaged_median] = Explains(problem, *state);
  const auto [chained_mean, chained_median] = Explains(problem, chained);
  start->averaged = averaged_mean <= chained_mean;
  start->median_px = start->averaged ? averaged_median : chained_median;
  if (!start->averaged) *state = chained;
}

// Messages.

/// How much of the lists is written.
struct MessageLimits {
  size_t groups, names, letters;
};

std::string Name(const Problem& problem, const RigState& state, int rank, const MessageLimits& limits) {
  const std::string& name = state.cameras[problem.camera_of[rank]].name;
  return name.size() <= limits.letters ? name : name.substr(0, limits.letters - 2) + "..";
}

std::string Names(const Problem& problem, const RigState& state, const std::vector<int>& group, const MessageLimits& limits) {
  std::string text = "{";
  for (size_t i = 0; i < std::min(group.size(), limits.names); ++i) {
    text += (i ? ", " : "") + Name(problem, state, group[i], limits);
  }
  if (group.size() > limits.names) text += ", " + std::to_string(group.size() - limits.names) + " more";
  return text + "}";
}

/// Frames in which each group saw a board.
std::vector<int> CountFrames(const Problem& problem, const PosedGroups& cameras) {
  std::vector<int> counts(cameras.groups.size(), 0);
  for (const PosedViews& frame : problem.frames) {
    std::set<int> groups;
    for (const PosedView& observation : frame) groups.insert(cameras.group_of[observation.camera]);
    for (int group : groups) ++counts[group];
  }
  return counts;
}

struct Miss {
  int rank_a = 0, rank_b = 0, group = 0;
  int64_t frame_a = 0, frame_b = 0;
  double gap = std::numeric_limits<double>::infinity();
};

/// The nearest frames of the first group and another; ties go to the larger group, then to the earlier frame.
Miss FindMiss(const Problem& problem, const PosedGroups& cameras, const RigState& state) {
  std::vector<std::pair<int64_t, int>> first;
  for (const PosedViews& frame : problem.frames) {
    for (const PosedView& observation : frame) {
      if (cameras.group_of[observation.camera] == 0) first.emplace_back(state.frames[observation.frame], observation.camera);
    }
  }
  std::sort(first.begin(), first.end());
  Miss best;
  for (size_t g = 1; g < cameras.groups.size(); ++g) {
    for (const PosedViews& frame : problem.frames) {
      for (const PosedView& observation : frame) {
        if (cameras.group_of[observation.camera] != static_cast<int>(g)) continue;
        const int64_t at = state.frames[observation.frame];
        const auto after = std::lower_bound(first.begin(), first.end(), std::make_pair(at, -1));
        for (int side = 0; side < 2; ++side) {
          if (side == 0 ? after == first.begin() : after == first.end()) continue;
          const auto near = side == 0 ? std::prev(after) : after;
          const double gap = std::abs(static_cast<double>(at) - static_cast<double>(near->first));
          if (gap < best.gap) best = {near->second, observation.camera, static_cast<int>(g), near->first, at, gap};
        }
      }
    }
  }
  return best;
}

std::string ClosestText(const Problem& problem, const Assembly& assembly, const RigState& state, const Miss& miss,
                        const MessageLimits& limits) {
  const std::string a = Name(problem, state, miss.rank_a, limits), b = Name(problem, state, miss.rank_b, limits);
  if (miss.gap > 0) {
    return "; closest are " + a + " in frame " + std::to_string(miss.frame_a) + " and " + b + " in frame " +
           std::to_string(miss.frame_b);
  }
  const RefusedBridge* most = nullptr;
  for (const RefusedBridge& refused : assembly.refused) {
    const auto groups = std::minmax(refused.group_a, refused.group_b);
    const bool fits = groups.first == 0 && groups.second == miss.group;
    if (fits && (!most || refused.frames > most->frames)) most = &refused;
  }
  return "; closest are " + a + " and " + b + ", which see different boards in frame " + std::to_string(miss.frame_a) +
         (most ? ": " + most->reason : "");
}

std::string MissingLink(const Problem& problem, const Assembly& assembly, const RigState& state, const Miss& miss,
                        const MessageLimits& limits) {
  const auto& groups = assembly.cameras.groups;
  const std::vector<int> frames = CountFrames(problem, assembly.cameras);
  const size_t listed = std::min(groups.size(), limits.groups);
  std::string text = "the cameras fall into " + std::to_string(groups.size()) + " groups that share no board: ", counts;
  for (size_t g = 0; g < listed; ++g) {
    text += (g ? ", " : "") + Names(problem, state, groups[g], limits);
    counts += (g ? ", " : "") + std::to_string(frames[g]);
  }
  if (groups.size() > listed) text += ", " + std::to_string(groups.size() - listed) + " more";
  text += " (" + counts + " frames)";
  const bool seen = std::isfinite(miss.gap);
  if (seen) text += ClosestText(problem, assembly, state, miss, limits);
  const MessageLimits one = {1, 1, limits.letters};
  text += "; film the board where a camera of " + Names(problem, state, groups[0], one) + " and one of " +
          Names(problem, state, groups[seen ? miss.group : 1], one) + " both see it";
  return text + (miss.gap > 0 ? ", or check that their frames are paired, or print boards on both sides"
                              : ", or turn the boards about several axes");
}

void Refuse(const Problem& problem, const Assembly& assembly, const RigState& state, RigStart* start) {
  constexpr size_t kMaxLetters = 400;
  const Miss miss = FindMiss(problem, assembly.cameras, state);
  if (std::isfinite(miss.gap)) {
    start->near_miss = {problem.camera_of[miss.rank_a], problem.camera_of[miss.rank_b], miss.frame_a, miss.frame_b};
  }
  start->status = Status::kDegenerate;
  constexpr MessageLimits kShorter[] = {{4, 6, 40}, {4, 3, 24}, {3, 2, 16}, {2, 1, 12}, {2, 1, 6}};
  for (const MessageLimits& limits : kShorter) {
    start->message = MissingLink(problem, assembly, state, miss, limits);
    if (start->message.size() < kMaxLetters) return;
  }
}

void Describe(const Problem& problem, const Assembly& assembly, RigStart* start) {
  for (const std::vector<int>& group : assembly.cameras.groups) {
    std::vector<int> cameras;
    for (int r : group) cameras.push_back(problem.camera_of[r]);
    std::sort(cameras.begin(), cameras.end());
    start->components.push_back(cameras);
  }
  start->component_frames = CountFrames(problem, assembly.cameras);
  std::vector<bool> seen(problem.num_boards, false);
  for (const PosedViews& frame : problem.frames) {
    for (const PosedView& observation : frame) seen[observation.board] = true;
  }
  auto groups = assembly.boards.groups;
  std::sort(groups.begin(), groups.end());
  for (const std::vector<int>& group : groups) {
    if (seen[group.front()]) start->board_components.push_back(group);
  }
}

}  // namespace

RigStart InitializeRig(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board, int reference,
                       RigState* state, const RigInitOptions& options) {
  CheckArguments(views, cam_from_board, reference, *state, options);
  RigStart start;
  const Problem problem = MakeProblem(views, cam_from_board, *state, options);
  const Assembly assembly = Assemble(problem);
  Describe(problem, assembly, &start);
  if (problem.frames.empty()) {
    start.status = Status::kTooFewViews;
    start.message = "no board was seen";
  } else if (assembly.cameras.groups.size() > 1) {
    Refuse(problem, assembly, *state, &start);
  } else {
    Choose(problem, assembly, reference, state, &start);
  }
  return start;
}

}  // namespace mvstudio::calib
