#pragma once

#include <string>

#include "core/image.h"

namespace mvstudio::dataset {

/// How a stored image is to be shown: mirrored left-right first, then turned clockwise. All eight ways of a rectangle.
struct ImageTurn {
  bool mirrored = false;
  int quarter_turns_clockwise = 0;  ///< 0 to 3

  bool any() const { return mirrored || quarter_turns_clockwise != 0; }
  bool swaps_sides() const { return quarter_turns_clockwise % 2 != 0; }
  bool operator==(const ImageTurn& other) const {
    return mirrored == other.mirrored && quarter_turns_clockwise == other.quarter_turns_clockwise;
  }
};

/// Of EXIF's and TIFF's tag Orientation, 1 to 8; none for other numbers.
ImageTurn TurnOfOrientation(int orientation);

/// "a turn of 90 degrees clockwise", "a mirror image (left-right)", both with "and".
std::string ToText(const ImageTurn& turn);

/// The image as it is to be shown.
Image Rotated(Image image, const ImageTurn& turn);

}  // namespace mvstudio::dataset
