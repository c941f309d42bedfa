#pragma once

#include <algorithm>
#include <vector>

namespace mvstudio {

/// Of the frames that somebody asked for, those that there are, sorted. Consecutive numbers are a range, of which takes that were
/// thinned out have some: one must be known. So must a number by itself. `refuse(frame)` throws for the first that is not.
template <class IsKnown, class Refuse>
std::vector<int> KnownFrames(std::vector<int> asked, const IsKnown& is_known, const Refuse& refuse) {
  std::sort(asked.begin(), asked.end());
  asked.erase(std::unique(asked.begin(), asked.end()), asked.end());
  std::vector<int> frames;
  for (size_t begin = 0; begin < asked.size();) {
    size_t end = begin + 1;
    while (end < asked.size() && asked[end] == asked[end - 1] + 1) ++end;
    const size_t before = frames.size();
    for (size_t i = begin; i < end; ++i) {
      if (is_known(asked[i])) frames.push_back(asked[i]);
    }
    if (frames.size() == before) refuse(asked[begin]);
    begin = end;
  }
  return frames;
}

}  // namespace mvstudio
