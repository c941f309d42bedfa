#pragma once

#include <cstdint>
#include <vector>

namespace mvstudio::avatar {

/// For each pixel of an image the index of the nearest one where `from` (H, W) is not 0, by steps to the four neighbours;
/// -1: none is reached. With a mask (H, W; null: all pixels) nothing outside it counts.
std::vector<int64_t> NearestPixels(int64_t height, int64_t width, const uint8_t* mask, const uint8_t* from);

/// Gives each unlabelled pixel (part 0) of a square image the part (H, W) and the coordinates (2, H, W) of the nearest
/// labelled one, by steps to the four neighbours. With a mask (H, W; null: all pixels), labels outside it are removed
/// first and nothing is spread there.
void SpreadLabels(int64_t size_px, const uint8_t* mask, uint8_t* part, float* uv);

}  // namespace mvstudio::avatar
