#pragma once

#include <array>
#include <cstdint>
#include <utility>

/// Which joints a bone joins. No tensors here.
namespace mvstudio::avatar {

/// The 18 bones between Panoptic's 19 joints, one input channel each (Shysheya et al., "Textured Neural Avatars", CVPR 2019).
inline constexpr std::array<std::pair<int, int>, 18> kBones = {{{0, 1},
                                                                {1, 15},
                                                                {15, 16},
                                                                {1, 17},
                                                                {17, 18},
                                                                {0, 2},
                                                                {0, 9},
                                                                {9, 10},
                                                                {10, 11},
                                                                {0, 3},
                                                                {3, 4},
                                                                {4, 5},
                                                                {2, 6},
                                                                {6, 7},
                                                                {7, 8},
                                                                {2, 12},
                                                                {12, 13},
                                                                {13, 14}}};
inline constexpr int64_t kNumBones = 18;

}  // namespace mvstudio::avatar
