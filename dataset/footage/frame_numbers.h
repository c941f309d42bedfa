#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace mvstudio::dataset {

/// The last number in a file name without its extension, if any.
std::optional<int64_t> NumberInName(const std::string& path);

/// The numbers of images, one for each file.
struct FrameNumbers {
  std::vector<int64_t> numbers;
  bool by_other_place = false;       ///< the last number in the name is one and the same in all files: another counts
  std::vector<bool> without_number;  ///< per file: its name has none, though others have; empty: none of them
};

/// The frame of each image, from its name. Of a pattern, the wildcards stand for the frame: the last number that they reach
/// into and that differs in all files, `left*_0.jpg` or `*/left.png`. Of a folder, the last number in the name. Where that is
/// the same in every file (that of a camera: 00_0.jpg, 01_0.jpg), the last that differs in all. A time of day with its date, or
/// whose seconds come twice, is one number that fits 32 bits, 2018-02-12__15-11-38: seconds since 2000-01-01, without a date
/// seconds of the day, and of names with parts of a second milliseconds of the day. So are milli-, micro- and
/// nanoseconds since 1970, 1403636579763555584. Without any numbers files have their
/// positions from 0; single ones without come after all others.
FrameNumbers NumberFrames(const std::string& path_or_pattern, const std::vector<std::string>& files);

}  // namespace mvstudio::dataset
