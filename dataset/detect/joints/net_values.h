// Private: for the nets of keypoints.
#pragma once

#include "core/image.h"
#include "dataset/detect/tfjs/tfjs_graph.h"

/// The numbers that go into a net, and what comes out of one as a probability.
namespace mvstudio::detect::internal {

/// (1, h, w, 3) with 0..255 mapped to -1..1.
FloatTensor ToSymmetric(const Image& rgb);
/// The same mapped to 0..1.
FloatTensor ToUnit(const Image& rgb);
float SigmoidOf(float x);

}  // namespace mvstudio::detect::internal
