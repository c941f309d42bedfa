// Precompiled for the modules that know Eigen. A file still includes what it uses.
#pragma once

#include <Eigen/Dense>

#include "pch_std.h"
