#pragma once

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Sets the weights of gross errors in a view to 0: homographies through four random corners (Fischler and Bolles, "Random
/// sample consensus", 1981; scored as MSAC by Torr and Zisserman, 2000), then the smooth image of a plane through the
/// inliers. Handles up to half of wrong corners. The threshold is coarse, some hundredths of the board's size in the
/// image: for a start, not for the final rejection. Returns the number of corners that lost their weight; views where
/// fewer than a quarter of the corners agree stay unchanged. Deterministic.
int ScreenView(View* view);

}  // namespace mvstudio::calib
