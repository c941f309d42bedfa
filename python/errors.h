// Private: for the Python module alone.
#pragma once

#include <pybind11/pybind11.h>

namespace mvstudio::python {

/// From here on every exception of ours becomes a mvstudio.Error with the code that the command line gives it.
void TranslateErrors();

}  // namespace mvstudio::python
