#include "triangulate/skeleton/problem.h"

#include <algorithm>
#include <numeric>
#include <set>

namespace mvstudio::triangulate::internal {

bool IsOk(const Window& window, size_t f, size_t j) { return window.At(f, j).point.status == Status::kOk; }

std::optional<size_t> NearestOk(const Window& window, size_t f, size_t j, int step, int max_frames) {
  for (std::ptrdiff_t k = static_cast<std::ptrdiff_t>(f) + step;
       k >= 0 && k < static_cast<std::ptrdiff_t>(window.frames.size()); k += step) {
    const size_t at = static_cast<size_t>(k);
    if (window.FramesApart(at, f) > max_frames) return std::nullopt;
    if (IsOk(window, at, j)) return at;
  }
  return std::nullopt;
}

namespace {

/// Standard deviation of a joint's acceleration; 0: none is known, so nothing holds the joint together over time.
double AccelerationSigma(const Terms& terms, size_t j) {
  return terms.smoothness > 0 ? terms.smoothness * terms.acceleration_m[j] : 0;
}

void AddPositions(SkeletonProblem* problem, Unknowns* unknowns) {
  const Window& window = *problem->window;
  const Eigen::Vector3d origin = problem->rig->origin_in_world;
  const int max_fill = problem->terms->max_fill_frames;
  problem->variable.assign(window.cells.size(), -1);
  unknowns->x_in_local.assign(window.cells.size(), Eigen::Vector3d::Zero());
  for (size_t f = 0; f < window.frames.size(); ++f) {
    for (size_t j = 0; j < window.num_joints; ++j) {
      const size_t cell = f * window.num_joints + j;
      if (IsOk(window, f, j)) {
        unknowns->x_in_local[cell] = window.At(f, j).point.x_in_world - origin;
      } else {
        if (!(AccelerationSigma(*problem->terms, j) > 0)) continue;
        const auto before = NearestOk(window, f, j, -1, max_fill), after = NearestOk(window, f, j, 1, max_fill);
        if (!before || !after) continue;
        const double t =
            static_cast<double>(window.frames[f] - window.frames[*before]) / (window.frames[*after] - window.frames[*before]);
        unknowns->x_in_local[cell] =
            (1 - t) * window.At(*before, j).point.x_in_world + t * window.At(*after, j).point.x_in_world - origin;
      }
      problem->variable[cell] = problem->num_positions++;
    }
  }
}

void AddDetections(SkeletonProblem* problem) {
  for (size_t cell = 0; cell < problem->variable.size(); ++cell) {
    if (problem->variable[cell] < 0) continue;
    const Cell& of = problem->window->cells[cell];
    if (problem->terms->robust) {
      for (size_t i = 0; i < of.observations.size(); ++i) {
        if (of.observations[i].px.allFinite()) problem->seen.push_back({cell, i});
      }
    } else if (of.point.status == Status::kOk) {
      for (const int i : of.point.used) problem->seen.push_back({cell, static_cast<size_t>(i)});
    }
  }
}

void AddAccelerations(SkeletonProblem* problem) {
  const Window& window = *problem->window;
  for (size_t j = 0; j < window.num_joints; ++j) {
    const double sigma = AccelerationSigma(*problem->terms, j);
    if (!(sigma > 0)) continue;
    std::vector<size_t> present;
    for (size_t f = 0; f < window.frames.size(); ++f) {
      if (problem->variable[f * window.num_joints + j] >= 0) present.push_back(f);
    }
    for (size_t k = 2; k < present.size(); ++k) {
      const double t0 = window.frames[present[k - 2]], t1 = window.frames[present[k - 1]], t2 = window.frames[present[k]];
      if (window.FramesApart(present[k - 2], present[k]) > 2 * problem->terms->max_fill_frames + 2) continue;
      const double scale = 2 / (t2 - t0) / sigma;
      Triple triple;
      for (int i = 0; i < 3; ++i) triple.cell[i] = present[k - 2 + static_cast<size_t>(i)] * window.num_joints + j;
      triple.c[0] = scale / (t1 - t0), triple.c[2] = scale / (t2 - t1), triple.c[1] = -triple.c[0] - triple.c[2];
      problem->triples.push_back(triple);
    }
  }
}

void AddBones(const Bones& bones, SkeletonProblem* problem) {
  problem->length_node.assign(bones.size(), -1);
  if (!(problem->terms->bone_lengths > 0)) return;
  for (size_t b = 0; b < bones.size(); ++b) {
    if (!((*problem->known)[b].sigma_m > 0)) continue;
    for (size_t f = 0; f < problem->window->frames.size(); ++f) {
      const size_t first = f * problem->window->num_joints;
      const size_t cell_a = first + static_cast<size_t>(bones[b].first), cell_b = first + static_cast<size_t>(bones[b].second);
      if (problem->variable[cell_a] < 0 || problem->variable[cell_b] < 0) continue;
      problem->bones.push_back({b, cell_a, cell_b});
      if (problem->length_node[b] < 0) problem->length_node[b] = problem->num_positions + problem->num_lengths++;
    }
  }
}

/// The joints, those first that the fewest others need (minimum degree), and to which group of joined ones each belongs.
struct JointOrder {
  std::vector<size_t> joints;
  std::vector<size_t> group;  // (joints) a joint of its group
  size_t largest = 1;         // number of joints of the largest group
};

JointOrder OrderJoints(const SkeletonProblem& problem) {
  const size_t count = problem.window->num_joints;
  std::vector<std::set<size_t>> neighbours(count);
  JointOrder order;
  order.group.resize(count);
  std::iota(order.group.begin(), order.group.end(), size_t{0});
  const auto root = [&order](size_t joint) {
    while (order.group[joint] != joint) joint = order.group[joint] = order.group[order.group[joint]];
    return joint;
  };
  for (const Bone& bone : problem.bones) {
    const size_t a = bone.cell_a % count, b = bone.cell_b % count;
    neighbours[a].insert(b), neighbours[b].insert(a);
    order.group[root(a)] = root(b);
  }
  std::vector<size_t> sizes(count, 0);
  std::set<std::pair<size_t, size_t>> left;  // degree, joint
  for (size_t j = 0; j < count; ++j) {
    order.group[j] = root(j);
    order.largest = std::max(order.largest, ++sizes[order.group[j]]);
    left.insert({neighbours[j].size(), j});
  }
  while (!left.empty()) {
    const size_t joint = left.begin()->second;
    left.erase(left.begin());
    order.joints.push_back(joint);
    for (const size_t a : neighbours[joint]) {
      left.erase({neighbours[a].size(), a});
      neighbours[a].erase(joint);
      for (const size_t b : neighbours[joint]) {
        if (b != a) neighbours[a].insert(b);
      }
      left.insert({neighbours[a].size(), a});
    }
  }
  return order;
}

}  // namespace

SkeletonProblem MakeProblem(const PreparedRig& rig, const Window& window, const Bones& bones,
                            const std::vector<KnownLength>& known, const Terms& terms, Unknowns* start) {
  SkeletonProblem problem{&rig, &window, &terms, &known};
  AddPositions(&problem, start);
  AddDetections(&problem);
  AddAccelerations(&problem);
  AddBones(bones, &problem);
  for (const KnownLength& each : known) start->length_m.push_back(each.length_m);
  return problem;
}

std::vector<std::vector<int>> EliminationGroups(const SkeletonProblem& problem) {
  const size_t count = problem.window->num_joints, num_frames = problem.window->frames.size();
  const JointOrder order = OrderJoints(problem);
  const bool smooth = !problem.triples.empty();
  const size_t length = smooth ? 4 + order.largest / 8 : 1, gap = smooth ? 2 : 0;  // near the least work
  std::vector<std::vector<int>> groups;
  const auto add = [&](size_t joint, size_t first, size_t last, std::vector<int>* group) {
    for (size_t f = first; f < std::min(last, num_frames); ++f) {
      if (const int node = problem.variable[f * count + joint]; node >= 0) group->push_back(node);
    }
  };
  const auto add_separators = [&](size_t first) {  // one for each group of joints
    std::vector<std::vector<int>> separators(count);
    for (const size_t joint : order.joints) add(joint, first, first + gap, &separators[order.group[joint]]);
    for (std::vector<int>& each : separators) groups.push_back(std::move(each));
  };
  for (size_t first = 0; first < num_frames; first += length + gap) {
    for (const size_t joint : order.joints) add(joint, first, first + length, &groups.emplace_back());
    if (first > 0 && smooth) add_separators(first - gap);
    if (first + length + gap >= num_frames && smooth) add_separators(first + length);
  }
  std::vector<std::vector<int>> lengths(count);
  for (const Bone& bone : problem.bones) {
    std::vector<int>& group = lengths[order.group[bone.cell_a % count]];
    if (const int node = problem.length_node[bone.bone]; group.empty() || group.back() != node) group.push_back(node);
  }
  groups.insert(groups.end(), lengths.begin(), lengths.end());
  groups.erase(std::remove_if(groups.begin(), groups.end(), [](const auto& group) { return group.empty(); }), groups.end());
  return groups;
}

}  // namespace mvstudio::triangulate::internal
