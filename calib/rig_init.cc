#include "calib/rig_init.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "calib/homography.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

/// One board seen by two cameras at the same time.
struct Shared {
  int view_a = 0, view_b = 0;
  int corners = 0;
};

/// Shared boards of every pair (a < b).
using PairMap = std::map<std::pair<int, int>, std::vector<Shared>>;

bool Used(const View& view) { return (view.weights.array() > 0).count() >= 4; }

PairMap CollectPairs(const std::vector<View>& views) {
  std::map<int, std::vector<int>> by_frame;
  for (size_t v = 0; v < views.size(); ++v) {
    if (Used(views[v])) by_frame[views[v].frame].push_back(static_cast<int>(v));
  }
  PairMap pairs;
  for (const auto& [frame, list] : by_frame) {
    for (int a : list) {
      for (int b : list) {
        if (views[a].camera_idx >= views[b].camera_idx) continue;
        const int corners = static_cast<int>(std::min(views[a].size(), views[b].size()));
        pairs[{views[a].camera_idx, views[b].camera_idx}].push_back({a, b, corners});
      }
    }
  }
  return pairs;
}

/// RMS-like disagreement of a relative pose with one shared board: how far board corners move in camera a, relative to their
/// depth.
double Disagreement(const Rigid3& a_from_b, const View& view, const Rigid3& a_from_board, const Rigid3& b_from_board) {
  double sum = 0;
  const Eigen::Index n = view.size();
  for (Eigen::Index i : {Eigen::Index{0}, n / 2, n - 1}) {
    const Eigen::Vector3d x = view.x_in_board.col(i);
    const Eigen::Vector3d direct = a_from_board * x;
    sum += (a_from_b * (b_from_board * x) - direct).norm() / std::max(1e-9, direct.norm());
  }
  return sum / 3;
}

/// The relative pose, of those of the shared boards, with the smallest median disagreement.
Rigid3 RelativePose(const std::vector<Shared>& shared, const std::vector<View>& views,
                    const std::vector<Rigid3>& cam_from_board) {
  constexpr size_t kMaxCandidates = 40;
  const size_t stride = std::max<size_t>(1, shared.size() / kMaxCandidates);
  Rigid3 best;
  double best_score = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < shared.size(); i += stride) {
    const Rigid3 candidate = cam_from_board[shared[i].view_a] * geometry::Inverse(cam_from_board[shared[i].view_b]);
    Eigen::VectorXd scores(shared.size());
    for (size_t k = 0; k < shared.size(); ++k) {
      const Shared& s = shared[k];
      scores[k] = Disagreement(candidate, views[s.view_a], cam_from_board[s.view_a], cam_from_board[s.view_b]);
    }
    const double score = Median(scores) - 1e-6 * shared[i].corners;
    if (score < best_score) best_score = score, best = candidate;
  }
  return best;
}

std::vector<std::vector<int>> Components(int num_cameras, const PairMap& pairs) {
  std::vector<int> group(num_cameras);
  for (int c = 0; c < num_cameras; ++c) group[c] = c;
  for (const auto& [pair, shared] : pairs) {
    const int from = group[pair.second], to = group[pair.first];
    for (int& g : group) g = g == from ? to : g;
  }
  std::vector<std::vector<int>> components;
  for (int g = 0; g < num_cameras; ++g) {
    std::vector<int> members;
    for (int c = 0; c < num_cameras; ++c) {
      if (group[c] == g) members.push_back(c);
    }
    if (!members.empty()) components.push_back(members);
  }
  std::stable_sort(components.begin(), components.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return components;
}

std::string Names(const RigState& state, const std::vector<int>& cameras) {
  std::string text = "{";
  for (size_t i = 0; i < cameras.size(); ++i) text += (i ? ", " : "") + state.cameras[cameras[i]].name;
  return text + "}";
}

std::string MissingLink(const RigState& state, const std::vector<std::vector<int>>& components) {
  std::string text =
      "the cameras fall into " + std::to_string(components.size()) + " groups that never see the board at the same time: ";
  for (size_t i = 0; i < components.size(); ++i) text += (i ? ", " : "") + Names(state, components[i]);
  return text + "; film the board where a camera of " + Names(state, components[0]) + " and one of " +
         Names(state, components[1]) + " both see it, or check that their frames are paired";
}

int SharedCorners(const std::vector<Shared>& shared) {
  int corners = 0;
  for (const Shared& s : shared) corners += s.corners;
  return corners;
}

/// Prim's algorithm from the reference camera.
void ChainCameras(const PairMap& pairs, const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board,
                  int reference, RigState* state) {
  std::vector<bool> placed(state->cameras.size(), false);
  state->cam_from_world.assign(state->cameras.size(), Rigid3());
  placed[reference] = true;
  for (size_t round = 1; round < state->cameras.size(); ++round) {
    const std::pair<const std::pair<int, int>, std::vector<Shared>>* best = nullptr;
    for (const auto& entry : pairs) {
      if (placed[entry.first.first] == placed[entry.first.second]) continue;
      if (!best || SharedCorners(entry.second) > SharedCorners(best->second)) best = &entry;
    }
    if (!best) return;
    const auto [a, b] = best->first;
    const Rigid3 a_from_b = RelativePose(best->second, views, cam_from_board);
    if (placed[a]) {
      state->cam_from_world[b] = geometry::Inverse(a_from_b) * state->cam_from_world[a];
    } else {
      state->cam_from_world[a] = a_from_b * state->cam_from_world[b];
    }
    placed[a] = placed[b] = true;
  }
}

/// Each board from the camera whose pose of it agrees best with all cameras that see it.
void PlaceBoards(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board, RigState* state) {
  std::map<int, std::vector<int>> by_frame;
  for (size_t v = 0; v < views.size(); ++v) {
    if (Used(views[v])) by_frame[views[v].frame].push_back(static_cast<int>(v));
  }
  state->world_from_board.assign(state->frames.size(), Rigid3());
  for (const auto& [frame, list] : by_frame) {
    double best_cost = std::numeric_limits<double>::infinity();
    for (int v : list) {
      const Rigid3 candidate = geometry::Inverse(state->cam_from_world[views[v].camera_idx]) * cam_from_board[v];
      double cost = 0;
      for (int u : list) {
        const int camera = views[u].camera_idx;
        const auto residuals = ResidualsOf(views[u], state->cameras[camera], state->cam_from_world[camera] * candidate);
        cost += residuals ? residuals->colwise().norm().cwiseMin(100).sum() : 1e3 * views[u].size();
      }
      if (cost < best_cost) best_cost = cost, state->world_from_board[frame] = candidate;
    }
  }
}

}  // namespace

RigStart InitializeRig(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board, int reference,
                       RigState* state, const RigInitOptions&) {
  RigStart result;
  const PairMap pairs = CollectPairs(views);
  result.components = Components(static_cast<int>(state->cameras.size()), pairs);
  if (views.empty()) {
    result.status = Status::kTooFewViews;
    result.message = "no board was seen";
  } else if (result.components.size() > 1) {
    result.status = Status::kDegenerate;
    result.message = MissingLink(*state, result.components);
  } else {
    ChainCameras(pairs, views, cam_from_board, reference, state);
    PlaceBoards(views, cam_from_board, state);
  }
  return result;
}

}  // namespace mvstudio::calib
