// Private: libmrcal's types, for mrcal_*.cc and the benchmarks.
#pragma once

#include <cstdint>
#include <vector>

extern "C" {
#include <mrcal/mrcal.h>
}

#include "calib/bundle/mrcal_engine.h"

/// The problem in mrcal's representation.
namespace mvstudio::calib::internal {

/// The arguments of mrcal_optimize. Its reference frame is the camera `reference`.
struct MrcalProblem {
  mrcal_lensmodel_t lens{};
  mrcal_problem_selections_t selections{};
  mrcal_calobject_warp_t warp{};
  double spacing_m = 0;
  int width = 0, height = 0, num_lens_params = 0;
  std::vector<double> intrinsics;        // num_lens_params per lens
  std::vector<int> image_sizes;          // width, height per lens
  std::vector<mrcal_pose_t> extrinsics;  // camera from reference
  std::vector<mrcal_pose_t> frames;      // reference from board
  std::vector<mrcal_observation_board_t> observations;
  std::vector<mrcal_point3_t> pool;  // per observation height x width: x, y, weight of the residual (negative: none)

  int reference = 0;                                ///< camera_idx
  int board = 0;                                    ///< index of the board in use
  std::vector<int> lens_of_camera, pose_of_camera;  ///< per camera, -1: not in use (pose: or the reference)
  std::vector<int> frame_of;                        ///< per frame of the state, -1: not in use
  std::vector<int> view_of_observation;

  int num_lenses() const { return static_cast<int>(image_sizes.size() / 2); }
  int num_states() const;
  int num_measurements() const;
};

/// Corners of a planar grid per row and column; width 0 for other boards.
MrcalProblem MakeMrcalProblem(const std::vector<View>& views, const RigState& state, const MrcalOptions& options);

/// Runs mrcal_optimize; false when it fails. `message` receives what it printed.
bool Optimize(MrcalProblem* problem, std::string* message);

/// Converts the solution to `state`, keeping the cameras or the board named by `gauge` in place; weights become 0 for
/// corners that mrcal rejected.
void ToState(const MrcalProblem& problem, const Gauge& gauge, std::vector<View>* views, RigState* state);

}  // namespace mvstudio::calib::internal
