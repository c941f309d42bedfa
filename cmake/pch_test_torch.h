// Precompiled for the tests of modules that know tensors. A file still includes what it uses.
#pragma once

#include <ATen/ATen.h>

#include "pch_test_eigen.h"
