#pragma once

#include <vector>

#include "calib/bundle/view.h"

/// Boards that were held still: many views, one piece of evidence.
namespace mvstudio::calib {

/// Number of each view's cluster, ascending by first appearance. Views of one camera and board belong together when their common
/// corners moved by less than a twentieth of the board's size in the image (median), whenever they were taken.
std::vector<int> ClusterViews(const std::vector<View>& views);

/// Number of each frame's cluster by the views' clusters (as from ClusterViews), -1 for frames that no view with a weight shows:
/// frames belong together when most of the cameras that see both see the board in the same place.
std::vector<int> ClusterFrames(const std::vector<View>& views, const std::vector<int>& cluster_of_view, size_t num_frames);

/// How many different numbers from 0 on there are.
int CountClusters(const std::vector<int>& clusters);

/// Residuals (2, N) per view, px, at a solution: correlation between those of one corner in different frames of a cluster, per
/// camera, between 0 (each frame is evidence of its own) and 1 (they repeat each other). 0 where no corner repeats.
std::vector<double> RepeatCorrelation(const std::vector<View>& views, const std::vector<int>& cluster_of_frame,
                                      const std::vector<Eigen::Matrix2Xd>& residuals, size_t num_cameras);

/// The views with weights divided by 1 + (n - 1) correlation, n being the views of their camera, board and cluster: what n
/// observations of equal correlation are worth (Kish, "Survey sampling", 1965: the design effect).
std::vector<View> DiscountRepeats(const std::vector<View>& views, const std::vector<int>& cluster_of_frame,
                                  const std::vector<double>& correlation);

}  // namespace mvstudio::calib
