#pragma once

#include <string>

#include "core/image.h"

namespace mvstudio::dataset {

/// An image that lies in another file: RGB, by the rules of ReadImage, without its orientation. `name` is that of errors.
Image ReadImageBytes(std::string bytes, const std::string& name);

}  // namespace mvstudio::dataset
