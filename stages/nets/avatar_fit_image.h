#pragma once

#include "avatar/body/files/textured_person.h"
#include "core/image.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// How far from the template the surface lies and how well it is known, each from the front and from the back.
struct SurfaceMaps {
  Image image;  ///< four panels side by side, (480, 4 x 470, 3)
  double
      offset_limit_mm;    ///< of the first two panels' scale, blue inwards, red outwards; dark: known worse than sigma_limit_mm
  double sigma_limit_mm;  ///< of the last two panels' scale, from light to red
};

/// Of a person with offsets and their standard deviations.
SurfaceMaps MapSurface(const body::TexturedPerson& person);

}  // namespace mvstudio::stages
