#pragma once

#include <utility>
#include <vector>

#include "core/image.h"
#include "dataset/pose/pose2d.h"

/// A net's score maps of the joints of a person in a square image, and reading positions from them.
namespace mvstudio::detect {

/// Grids over a crop. The middle of cell (y, x) is at pixel (origin_x_px + x * stride_px, origin_y_px + y * stride_px) of
/// the crop; every cell may predict an offset to the joint.
struct JointMaps {
  int joints = 0, height = 0, width = 0;
  double stride_px = 1, origin_x_px = 0, origin_y_px = 0;
  std::vector<float> score;                   // (joints, height, width), 0..1
  std::vector<float> dx_px, dy_px;            // (joints, height, width), from the cell's middle to the joint; empty: no votes
  std::vector<float> prior_x_px, prior_y_px;  // (joints): where the person's joint is roughly; empty: unknown
  double prior_scale_px = 0;                  ///< a cell this far from the prior counts half,
  double prior_power = 1;                     ///< one farther off 1 / (1 + (distance / scale) ^ power)
};

/// The best position of every joint in crop pixels, with its score 0..1. With offsets: the mean of the positions predicted
/// around the best cell, weighted by score. Without: the best cell moved to the vertex of the parabola through its
/// neighbours' logarithms (Zhang et al. 2020, "DARK"). Cells are weighted by the prior where there is one.
std::vector<dataset::Keypoint2d> ReadJoints(const JointMaps& maps);

/// Flips the maps of a mirrored crop back and averages scores and offsets with those of the crop. `mirror` lists the pairs
/// of joints to exchange.
JointMaps AverageMirrored(const JointMaps& maps, const JointMaps& mirrored, const std::vector<std::pair<int, int>>& mirror,
                          int crop_px);

/// A square of the image: centre and side in its pixels. The crop's right is the image's, rotated clockwise by
/// `angle_rad`.
struct Crop {
  double x_px = 0, y_px = 0, size_px = 0, angle_rad = 0;
};

/// The square around the joints that score at least `min_score`, rotated by `angle_rad`; their longer extent takes `fill`
/// of it. Size 0: no joint.
Crop CropAround(const dataset::Person2d& pose, double fill, double min_score, double angle_rad = 0);

/// Lean of a person: the rotation that makes the line from hips to shoulders upright. 0 when these joints score less than
/// `min_score`, or the pose is not one of this skeleton.
double LeanOf(const dataset::Person2d& pose, const geometry::Skeleton& skeleton, double min_score);

/// The joints of `to` by their names in `from`; score 0 for those that `from` lacks.
dataset::Person2d OnSkeleton(const dataset::Person2d& pose, const geometry::Skeleton& from, const geometry::Skeleton& to);

/// The crop scaled to `size` x `size`: the mean of bilinear samples over each pixel's footprint; mid-grey outside the
/// image.
Image CutCrop(const Image& rgb, const Crop& crop, int size);
Image MirrorImage(const Image& rgb);

/// From pixels of the full image to those of the scaled crop, and back.
dataset::Keypoint2d ToCrop(const dataset::Keypoint2d& in_image, const Crop& crop, int size);
dataset::Keypoint2d FromCrop(const dataset::Keypoint2d& in_crop, const Crop& crop, int size);

}  // namespace mvstudio::detect
