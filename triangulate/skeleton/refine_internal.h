#pragma once

#include <Eigen/SparseCore>
#include <cstdlib>
#include <limits>
#include <optional>
#include <vector>

#include "triangulate/skeleton/refine.h"

/// Steps of RefineSkeleton; included by the .cc files of this folder and their tests only.
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
};

/// `known`: (bones) initial lengths, which are also priors; sigma 0: the bone is never seen and has no term.
WindowSolution SolveWindow(const PreparedRig& rig, const Window& window, const Bones& bones,
                           const std::vector<KnownLength>& known, const Terms& terms, int max_iterations);

std::vector<Point> PointsOf(const Window& window);

/// Frames [first, last) by index.
Window Part(const Window& window, size_t first, size_t last);

/// Lengths of a bone where both its joints are kOk, metres; `points`: (frames, joints).
std::vector<double> BoneLengths(const std::vector<Point>& points, size_t num_joints, const std::pair<int, int>& bone);

/// Median and robust spread of each bone; sigma 0 where it is seen in fewer than 5 frames.
std::vector<KnownLength> MeasureLengths(const Window& window, const Bones& bones);

/// Decides which terms are used and with what weights; `terms` holds the values that the take itself gives. Fills the
/// report except its bones.
Terms ChooseTerms(const PreparedRig& rig, const std::vector<Window>& persons, const Bones& bones, const PointSolver& solve,
                  const SkeletonRefineOptions& options, Terms terms, const RunContext& run, SkeletonRefineReport* report);

constexpr int kMinLengthFrames = 5;

/// Entries of the inverse of a symmetric positive definite matrix at the nonzeros of its Cholesky factor. These include
/// its diagonal and every block of the matrix itself (Takahashi, Fagan, Chin, 1973; Erisman and Tinney, 1975).
class SelectedInverse {
 public:
  /// Only the lower triangle of `matrix` is read. `ok()` is false when it is not positive definite.
  explicit SelectedInverse(const Eigen::SparseMatrix<double>& matrix);
  bool ok() const { return ok_; }
  double operator()(Eigen::Index row, Eigen::Index col) const;

 private:
  bool ok_ = false;
  Eigen::SparseMatrix<double> inverse_;  // lower triangle, in the factor's order
  Eigen::VectorXi order_;
};

}  // namespace mvstudio::triangulate::internal
