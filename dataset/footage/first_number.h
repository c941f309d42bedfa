#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mvstudio::dataset {

/// Number `first` becomes 0, in a map by numbers.
template <class Map>
void NumberFrom(int first, Map* by_number) {
  Map moved;
  for (auto& [number, value] : *by_number) moved.emplace_hint(moved.end(), number - first, std::move(value));
  *by_number = std::move(moved);
}

/// Where numbers of files begin that are those of frames.
enum class FirstNumber {
  kAsFrames,  ///< nothing speaks for another beginning
  kOne,       ///< 1 to N without a gap, of N frames from 0: the last number would have no frame
  kUnclear,   ///< from 1 without a gap, of another or unknown number of frames; or with gaps up to the N of N frames
};

/// `num_frames`: of footage whose frames count from 0; 0: unknown.
FirstNumber FirstNumberOf(const std::set<int64_t>& numbers, int64_t num_frames);

/// How many frames the footage has, where they count from 0: a video (0: it does not say), or images 0 to N - 1. Nothing for
/// images with other numbers, and for footage that cannot be read.
std::optional<int64_t> FramesFrom0(const std::string& path_or_pattern);

/// Of the numbers of all cameras' joints: kOne where it is so for every footage, kUnclear where for some; kAsFrames also where
/// one's frames do not count from 0.
FirstNumber FirstNumberOf(const std::set<int64_t>& numbers, const std::vector<std::string>& footage);

}  // namespace mvstudio::dataset
