#pragma once

#include <boost/multiprecision/eigen.hpp>
#include <boost/multiprecision/mpfr.hpp>

namespace mvstudio::testing {

#ifdef MVSTUDIO_MP_DIGITS
inline constexpr unsigned kMpDigits = MVSTUDIO_MP_DIGITS;  // of a whole test program
#else
inline constexpr unsigned kMpDigits = 60;
#endif

/// Numbers of that many decimal digits (MPFR), for oracles. Works as an Eigen scalar.
using Mp = boost::multiprecision::number<boost::multiprecision::mpfr_float_backend<kMpDigits>, boost::multiprecision::et_off>;

}  // namespace mvstudio::testing
