// Private: for the nets of keypoints and the search for persons.
#pragma once

#include <string>
#include <vector>

#include "core/image.h"
#include "dataset/detect/joints/joint_net.h"
#include "dataset/detect/tfjs/tfjs_graph.h"

namespace mvstudio::detect::internal {

/// PoseNet's four outputs for one image; x of a displacement or offset after all y of its kind.
struct PosenetOutputs {
  FloatTensor heat, offset, forward, backward;
};

class PosenetGraph {
 public:
  explicit PosenetGraph(const std::string& models_folder);
  PosenetOutputs Run(const Image& rgb) const;

 private:
  TfjsGraph graph_;
};

inline constexpr int kPosenetStride = 16;

/// People in the net's pixels, by the score of the joint at which their decoding started.
std::vector<CoarsePerson> DecodePeople(const PosenetOutputs& outputs);

}  // namespace mvstudio::detect::internal
