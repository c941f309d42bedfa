// Private: pybind11's types.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <functional>

#include "core/progress.h"

namespace mvstudio::python {

/// What every long function takes besides its own arguments.
struct RunArguments {
  pybind11::object progress;  ///< called with (stage, done, total, note), or None
  int threads = 0;
  uint64_t seed = 1;
};

/// Does `work` on a thread of its own. This one, which holds Python's lock only in between, reports progress to the callback
/// and hears signals twenty times a second: after Ctrl-C or an exception of the callback the work is cancelled through its
/// RunContext, and the exception goes on when it has ended. Exceptions of the work are thrown here.
void RunWatched(const RunArguments& arguments, const std::function<void(const RunContext&)>& work);

}  // namespace mvstudio::python
