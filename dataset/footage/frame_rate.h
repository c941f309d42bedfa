#pragma once

namespace mvstudio::dataset {

/// Whether footage may have so many frames a second: from one in a quarter of an hour on.
constexpr bool IsFrameRate(double hz) { return hz >= 1e-3 && hz <= 1e6; }
/// Whether two rates are one in other words: 29.97 and 30, not 25 and 24.
constexpr bool IsSameRate(double a_hz, double b_hz) { return a_hz < 1.002 * b_hz && b_hz < 1.002 * a_hz; }
constexpr char kFrameRates[] = "must be frames a second, from 0.001 to 1000000";

}  // namespace mvstudio::dataset
