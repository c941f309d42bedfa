#pragma once

namespace mvstudio {

constexpr double kPi = 3.14159265358979323846;
constexpr double DegToRad(double deg) { return deg * kPi / 180.0; }
constexpr double RadToDeg(double rad) { return rad * 180.0 / kPi; }

/// Whether footage may have so many frames a second: from one in a quarter of an hour on.
constexpr bool IsFrameRate(double hz) { return hz >= 1e-3 && hz <= 1e6; }
constexpr char kFrameRates[] = "must be frames a second, from 0.001 to 1000000";

}  // namespace mvstudio
