#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "avatar/nets/model.h"

namespace mvstudio::avatar {

/// A new network that begins with the weights of another.
struct StartNetwork {
  AvatarModel model;                ///< grey textures, the other's depth range, step 0
  std::vector<std::string> taken;   ///< layers with all weights of the other
  std::vector<std::string> partly;  ///< layers with the other's weights for the input channels that both have, 0 for the rest
  std::vector<std::string> fresh;   ///< layers that begin at random
  bool initialised = false;         ///< it is of the other's method, or of one without an initialisation
};

/// `options`: those of `from` but for method, template_colours and texture_px. A network of the same method takes every
/// layer. Of another method the decoders correspond in order (parts and mask, coordinates and colours); their heads, whose
/// outputs mean other things, begin anew, and the first layer takes the channels of bones, template, its colours and earlier
/// images that both have. Throws ContractViolation for other differences.
StartNetwork StartFrom(const AvatarModel& from, const ModelOptions& options, int size_px, uint64_t seed);

}  // namespace mvstudio::avatar
