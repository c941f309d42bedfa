#pragma once

#include <string>
#include <vector>

#include "core/error.h"

namespace mvstudio {

/// Of the frames that were asked for not one is there (exit code 4).
class NothingLeftError : public Error {
 public:
  using Error::Error;
};

struct FrameChoice {
  std::vector<int> frames;  ///< sorted
  std::string beyond;       ///< what was asked for before the first frame or after the last, as a sentence; empty: nothing
};

/// Of the frames that `option` asks for, those that `source` has. Consecutive numbers are a range, of which takes that were
/// thinned out have some: one must be known. So must a number by itself: UsageError. NothingLeftError where none of all is
/// there. Messages say which frames there are.
FrameChoice KnownFrames(const std::string& option, std::vector<int> asked, std::vector<int> there, const std::string& source);

}  // namespace mvstudio
