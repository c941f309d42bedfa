#pragma once

#include <string>
#include <vector>

namespace mvstudio::calib {

/// Judgement of a calibration, with the figures that decided it.
struct Verdict {
  struct Reason {
    std::string code;  ///< stable, docs/reliability.md lists them all
    std::string text;  ///< one line: camera, figure, limit
    std::string hint;  ///< what to do
    bool fails = false;  ///< it alone makes the verdict `fail`; else a warning
  };
  std::string status = "pass";  ///< pass, warn or fail
  std::vector<Reason> reasons;  ///< empty for pass
};

}  // namespace mvstudio::calib
