// Private: the solver of RefineSkeleton.
#pragma once

#include <utility>
#include <vector>

#include "triangulate/skeleton/refine.h"

/// A stretch of a person's take, the terms that hold its joints together, and its solution.
namespace mvstudio::triangulate::internal {

using Bones = std::vector<std::pair<int, int>>;

/// One joint in one frame.
struct Cell {
  size_t take_idx = 0;
  Point point;                            // as triangulated
  std::vector<Observation> observations;  // that it may use
};

/// Consecutive frames of one person.
struct Window {
  int person = 0;
  std::vector<int> frames;  // ascending
  size_t num_joints = 0;
  std::vector<Cell> cells;      // (frames, joints)
  std::vector<int> clips = {};  // (frames) ascending number of the clip; empty: one clip

  const Cell& At(size_t frame_idx, size_t joint_idx) const { return cells[frame_idx * num_joints + joint_idx]; }
  Cell& At(size_t frame_idx, size_t joint_idx) { return cells[frame_idx * num_joints + joint_idx]; }
  /// Time between two frames, by index; without end across a cut.
  int FramesApart(size_t a, size_t b) const {
    const bool one_clip = clips.empty() || clips[a] == clips[b];
    return one_clip ? std::abs(frames[a] - frames[b]) : std::numeric_limits<int>::max();
  }
};

struct Terms {
  bool robust = false;
  double smoothness = 0, bone_lengths = 0;  // weights, 0: off
  std::vector<double> acceleration_m;       // (joints) typical size, m / frame^2
  int max_fill_frames = 0;
  double max_fill_sigmas = 0;
  double shared_error = 0;  // 0..1: part of a single point's covariance that the terms do not average away

  bool Any() const { return robust || smoothness > 0 || bone_lengths > 0; }
};

/// A known length, metres.
struct KnownLength {
  double length_m = 0, sigma_m = 0;
};

struct WindowSolution {
  std::vector<Point> points;         // (cells)
  std::vector<KnownLength> lengths;  // (bones); sigma 0 where the term is off or the bone never seen
  bool solved = true;                // false: the points are those given, because the system is singular
};

/// `known`: (bones) initial lengths, which are also priors; sigma 0: the bone is never seen and has no term.
/// Throws CancelledError between two steps.
WindowSolution SolveWindow(const PreparedRig& rig, const Window& window, const Bones& bones,
                           const std::vector<KnownLength>& known, const Terms& terms, int max_iterations,
                           const RunContext& run = {});

std::vector<Point> PointsOf(const Window& window);

/// Frames [first, last) by index.
Window Part(const Window& window, size_t first, size_t last);

/// Lengths of a bone where both its joints are kOk, metres; `points`: (frames, joints).
std::vector<double> BoneLengths(const std::vector<Point>& points, size_t num_joints, const std::pair<int, int>& bone);

/// Median and robust spread of each bone; sigma 0 where it is seen in fewer than 5 frames.
std::vector<KnownLength> MeasureLengths(const Window& window, const Bones& bones);

constexpr int kMinLengthFrames = 5;

}  // namespace mvstudio::triangulate::internal
