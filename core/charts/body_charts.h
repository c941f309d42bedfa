#pragma once

#include <array>

namespace mvstudio {

/// Charts of a body surface, numbered like DensePose's parts (Güler et al., CVPR 2018): 1..24, 0 is background.
inline constexpr int kNumBodyCharts = 24;

/// Groups of similar charts, whose v runs along the body in the same direction. Front and back of the trunk, hands, feet,
/// quarters of the upper and lower legs and of the upper and lower arms, halves of the head. Pairs are listed twice.
inline constexpr std::array<std::array<int, 4>, 8> kAlikeCharts = {{{1, 2, 1, 2},
                                                                    {3, 4, 3, 4},
                                                                    {5, 6, 5, 6},
                                                                    {7, 8, 9, 10},
                                                                    {11, 12, 13, 14},
                                                                    {15, 16, 17, 18},
                                                                    {19, 20, 21, 22},
                                                                    {23, 24, 23, 24}}};

}  // namespace mvstudio
