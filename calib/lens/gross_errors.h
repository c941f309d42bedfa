#pragma once

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Sets to 0 the weights of corners that disagree grossly with the others of their view: homographies through four random
/// corners (Fischler and Bolles, "Random sample consensus", 1981; scored as by Torr and Zisserman, MSAC, 2000), then the smooth
/// image of a plane through those that agree. Made for up to half of wrong corners. It judges coarsely, by some hundredths of
/// the board's size in the image: to find a start, not to reject in the end. Returns how many corners lost their weight; views
/// where no quarter of the corners agree stay as they are. Deterministic.
int ScreenView(View* view);

}  // namespace mvstudio::calib
