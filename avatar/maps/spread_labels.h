#pragma once

#include <cstdint>

namespace mvstudio::avatar {

/// Gives each unlabelled pixel (part 0) of a square image the part (H, W) and the coordinates (2, H, W) of the nearest
/// labelled one, by steps to the four neighbours. With a mask (H, W; null: all pixels), labels outside it are removed
/// first and nothing is spread there.
void SpreadLabels(int64_t size_px, const uint8_t* mask, uint8_t* part, float* uv);

}  // namespace mvstudio::avatar
