#pragma once

#include <boost/multiprecision/eigen.hpp>
#include <boost/multiprecision/mpfr.hpp>

namespace mvstudio::testing {

/// Numbers of 60 decimal digits (MPFR), for oracles. Works as an Eigen scalar.
using Mp = boost::multiprecision::number<boost::multiprecision::mpfr_float_backend<60>, boost::multiprecision::et_off>;

}  // namespace mvstudio::testing
