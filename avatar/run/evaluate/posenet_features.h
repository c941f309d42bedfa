#pragma once

#include <memory>
#include <string>

#include "avatar/nets/feature_net.h"

namespace mvstudio::avatar {

/// PoseNet's trunk (MobileNet v1, `mvstudio models fetch`) as a feature net: activations of its pointwise convolutions 1,
/// 3, 5 and 7 (strides 2, 4, 8, 16); pooled: the mean of number 13 over the image. Throws MissingToolError when it is not
/// installed, FormatError when it is damaged. `folder`: of the models, empty for the default.
std::shared_ptr<const FeatureNet> PoseNetFeatures(const std::string& folder = "");

/// By name: "none" (null), "posenet", "auto" (posenet when it is installed, else null), or a TorchScript file.
std::shared_ptr<const FeatureNet> FeatureNetByName(const std::string& name, const std::string& models_folder = "");

}  // namespace mvstudio::avatar
