#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "avatar/body/offset_net/offset_atlas.h"

/// Offsets of a surface as a network of the posed body: Zhao et al., "High-Fidelity Human Avatars from a Single RGB Camera",
/// CVPR 2022, section 3.1. A U-Net of the map of the posed surface gives a pose feature; an MLP of eight layers takes it, a
/// learned geometry feature and the place on the surface to an offset. avatar/surface trains it.
namespace mvstudio::body {

struct OffsetNetSizes {
  int unet_width = 16;         ///< channels of the U-Net's finest level; doubled at each of three coarser ones
  int pose_channels = 16;      ///< of the pose feature; the paper has 64
  int geometry_channels = 16;  ///< of the geometry feature; the paper has 64
  int mlp_width = 64;          ///< of the MLP; the paper has 256
};

inline constexpr int kOffsetNetDowns = 3, kOffsetNetLayers = 8;
inline constexpr int kOffsetNetSkipAt = 4;         ///< the layer that takes the features again
inline constexpr double kOffsetNetLeak = 0.1;      ///< slope of the MLP below 0; the paper's is 0
inline constexpr double kOffsetNetMostM = 0.1;     ///< of each coordinate of an offset
inline constexpr double kOffsetNetStiffness = 10;  ///< of OffsetSmoother

/// An array of weights, row by row.
struct NetArray {
  std::vector<int64_t> shape;
  std::vector<float> values;
};
using NetArrays = std::map<std::string, NetArray>;

/// What is taken off the map of positions, and what it is divided by: the poses trained on.
struct PositionNorm {
  Eigen::Matrix3Xf mean;  ///< (3, kHeight * kWidth) metres
  float spread = 1;       ///< metres; the root of the mean square of what is left
};
PositionNorm NormOf(const OffsetAtlas& atlas, const std::vector<Eigen::Matrix3Xf>& posed);
/// (PositionMap - mean) / spread, at most 100 in size.
Eigen::Matrix3Xf NormalPositions(const OffsetAtlas& atlas, const PositionNorm& norm, const Eigen::Matrix3Xf& posed);

/// All arrays by name: convolutions (out, in, k, k) and layers (out, in) `.weight`, `.bias` (out); `geometry` (channels,
/// OffsetAtlas::kHeight, kWidth); `mean` (3, kHeight, kWidth) and `spread` (1) of PositionNorm.
std::vector<std::pair<std::string, std::vector<int64_t>>> OffsetNetShapes(const OffsetNetSizes& sizes);

struct NetProblem {
  std::string array, what;
};
/// Why `arrays` are not those of a network; nothing: they are.
std::optional<NetProblem> ProblemOf(const NetArrays& arrays);

/// The network of a body, on the CPU in single precision.
class OffsetNet : public MovingOffsets {
 public:
  /// Throws ContractViolation where ProblemOf has something to say.
  OffsetNet(const BodyTemplate& body, NetArrays arrays);
  Eigen::Matrix3Xf At(const Eigen::Matrix3Xf& posed) const override;
  const NetArrays& arrays() const { return arrays_; }
  Eigen::Index num_vertices() const { return atlas_.vertex_px.cols(); }

 private:
  OffsetAtlas atlas_;
  OffsetSmoother smoother_;
  NetArrays arrays_;
};

}  // namespace mvstudio::body
