#pragma once

namespace mvstudio::dataset {

/// Whether footage may have so many frames a second: from one in a quarter of an hour on.
constexpr bool IsFrameRate(double hz) { return hz >= 1e-3 && hz <= 1e6; }
constexpr char kFrameRates[] = "must be frames a second, from 0.001 to 1000000";

}  // namespace mvstudio::dataset
