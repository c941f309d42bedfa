#pragma once

#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/view.h"

/// Errors that the corners of one image share and that move a board as a whole: blur, a print off by a little, compression.
namespace mvstudio::calib {

/// Variance of the cameras' poses over that of independent corners, 1 or more, by how the boards of different time steps draw
/// the cameras apart. One number for the rig, since each camera sees few boards. `cluster_of_frame` as from ClusterFrames;
/// each cluster is one unit; of many, 400 evenly spaced ones count, and of rigs with more than 500 unknowns fewer, down to 20.
///
/// The estimate is that of VarianceByBoards (board_errors.h), of the whole rig with the boards' poses eliminated, measured
/// along the poses of the cameras that a unit shows. VarianceByBoards cannot see an error that moves the board in one image,
/// since each image has a pose of its own there. `state` and `options` are those with the terms that the lenses omit
/// (AddOmittedTerms), so that these are not counted twice; `sigma_px` is that of a corner of weight 1. The ratio is 1 unless it
/// exceeds 1 by one standard deviation, with fewer than six units, with splined lenses and without a free pose.
double PoseVarianceByFrames(const std::vector<View>& views, const std::vector<int>& cluster_of_frame, const RigState& state,
                            const BundleOptions& options, double sigma_px);

}  // namespace mvstudio::calib
