#include "dataset/footage/image_turn.h"

#include <algorithm>
#include <utility>

namespace mvstudio::dataset {

ImageTurn TurnOfOrientation(int orientation) {
  constexpr ImageTurn kTurns[] = {{false, 0}, {true, 0}, {false, 2}, {true, 2}, {true, 3}, {false, 1}, {true, 1}, {false, 3}};
  return orientation >= 1 && orientation <= 8 ? kTurns[orientation - 1] : ImageTurn{};
}

std::string ToText(const ImageTurn& turn) {
  const std::string rotated = "a turn of " + std::to_string(90 * turn.quarter_turns_clockwise) + " degrees clockwise";
  if (!turn.mirrored) return rotated;
  return "a mirror image (left-right)" + (turn.quarter_turns_clockwise == 0 ? "" : " and " + rotated);
}

Image Rotated(Image image, const ImageTurn& turn) {
  if (!turn.any()) return image;
  const int turns = turn.quarter_turns_clockwise, last_y = image.height - 1;
  Image out(turn.swaps_sides() ? image.height : image.width, turn.swaps_sides() ? image.width : image.height, image.channels);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const int from_left = turn.mirrored ? image.width - 1 - x : x, from_right = image.width - 1 - from_left;
      const int u = turns == 0 ? from_left : turns == 1 ? last_y - y : turns == 2 ? from_right : y;
      const int v = turns == 0 ? y : turns == 1 ? from_left : turns == 2 ? last_y - y : from_right;
      std::copy_n(image.Pixel(x, y), image.channels, out.Pixel(u, v));
    }
  }
  return out;
}

}  // namespace mvstudio::dataset
