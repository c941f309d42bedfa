#pragma once

#include <string>
#include <vector>

namespace mvstudio {

/// What the user should know of a result, a file or a footage: an assumption of a reader, a warning, a reason, an error.
struct Notice {
  std::string code;    ///< stable (`CAL-LOWCOV`), docs/reliability.md lists them all; may be empty
  std::string text;    ///< what and where, with figures
  std::string hint;    ///< what to do; may be empty
  bool fails = false;  ///< a quality gate failed for it, or it is an error; else a warning
};

inline void Append(const std::vector<Notice>& more, std::vector<Notice>* notices) {
  notices->insert(notices->end(), more.begin(), more.end());
}

}  // namespace mvstudio
