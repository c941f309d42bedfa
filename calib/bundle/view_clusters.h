#pragma once

#include <vector>

#include "calib/bundle/view.h"

/// Boards that were held still: many views, but not independent observations.
namespace mvstudio::calib {

/// Cluster index of each view, numbered by first appearance. Two views of one camera and board share a cluster if the
/// median motion of their common corners is below a twentieth of the board's size in the image. The time between them does
/// not matter.
std::vector<int> ClusterViews(const std::vector<View>& views);

/// Cluster index of each frame from the views' clusters (ClusterViews); -1 for frames without a weighted view. Two frames
/// share a cluster if most cameras that see both see the board in the same place.
std::vector<int> ClusterFrames(const std::vector<View>& views, const std::vector<int>& cluster_of_view, size_t num_frames);

/// Number of distinct indices >= 0.
int CountClusters(const std::vector<int>& clusters);

/// Correlation, per camera, between residuals of one corner in different frames of a cluster. `residuals` are (2, N) per
/// view, px, at a solution, all of one sign. 0: frames are independent; 1: they repeat each other. 0 where no corner repeats.
std::vector<double> RepeatCorrelation(const std::vector<View>& views, const std::vector<int>& cluster_of_frame,
                                      const std::vector<Eigen::Matrix2Xd>& residuals, size_t num_cameras);

/// The views with weights divided by 1 + (n - 1) correlation, where n counts the views of the same camera, board and
/// cluster. This is the information of n equally correlated observations (design effect; Kish, "Survey sampling", 1965).
std::vector<View> DiscountRepeats(const std::vector<View>& views, const std::vector<int>& cluster_of_frame,
                                  const std::vector<double>& correlation);

}  // namespace mvstudio::calib
