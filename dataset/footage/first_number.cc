#include "dataset/footage/first_number.h"

#include "core/error.h"
#include "dataset/footage/frames.h"

namespace mvstudio::dataset {

FirstNumber FirstNumberOf(const std::set<int64_t>& numbers, int64_t num_frames) {
  if (numbers.size() < 2 || *numbers.begin() < 1) return FirstNumber::kAsFrames;
  const bool gapless = *numbers.begin() == 1 && *numbers.rbegin() == static_cast<int64_t>(numbers.size());
  const bool ends_beyond = num_frames > 0 && *numbers.rbegin() == num_frames;
  if (gapless && ends_beyond) return FirstNumber::kOne;
  return gapless || ends_beyond ? FirstNumber::kUnclear : FirstNumber::kAsFrames;
}

std::optional<int64_t> FramesFrom0(const std::string& path_or_pattern) {
  try {
    const FootageFiles files = ListFootage(path_or_pattern);
    if (files.is_video) return DescribeFootage(path_or_pattern).num_frames;
    const std::set<int64_t> numbers(files.images.numbers.begin(), files.images.numbers.end());
    if (numbers.empty() || *numbers.begin() != 0 || *numbers.rbegin() + 1 != static_cast<int64_t>(numbers.size()))
      return std::nullopt;
    return static_cast<int64_t>(numbers.size());
  } catch (const Error&) {
    return std::nullopt;  // who reads the footage says why
  }
}

FirstNumber FirstNumberOf(const std::set<int64_t>& numbers, const std::vector<std::string>& footage) {
  if (numbers.empty() || *numbers.begin() != 1) return FirstNumber::kAsFrames;
  size_t ones = 0;
  bool unclear = false;
  for (const std::string& path : footage) {
    const std::optional<int64_t> num_frames = FramesFrom0(path);
    if (!num_frames) return FirstNumber::kAsFrames;
    const FirstNumber first = FirstNumberOf(numbers, *num_frames);
    ones += first == FirstNumber::kOne, unclear |= first != FirstNumber::kAsFrames;
  }
  return !footage.empty() && ones == footage.size() ? FirstNumber::kOne
         : unclear                                  ? FirstNumber::kUnclear
                                                    : FirstNumber::kAsFrames;
}

}  // namespace mvstudio::dataset
