// Precompiled for the modules that know tensors and Eigen. A file still includes what it uses.
#pragma once

#include <ATen/ATen.h>

#include "pch_eigen.h"
