// Precompiled for the tests of modules that know Eigen. A file still includes what it uses.
#pragma once

#include <Eigen/Dense>

#include "pch_test.h"
