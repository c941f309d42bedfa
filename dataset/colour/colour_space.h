// Private: the values that a colour match is computed in.
#pragma once

#include "dataset/colour/colour_match.h"

namespace mvstudio::dataset::internal {

/// sRGB transfer function (IEC 61966-2-1) of values 0..1; continues beyond 1 and is odd about 0.
double LinearFromSrgb(double srgb);
double SrgbFromLinear(double linear);
/// d linear / d srgb.
double LinearSlope(double srgb);

/// A stored value 0..1, converted to the space of gain and offset.
double ToSpace(double srgb, ColourSpace space);
/// sRGB value 0..1 after a camera's transform.
double Corrected(double srgb, const ColourTransform& t, int channel, ColourSpace space);

}  // namespace mvstudio::dataset::internal
