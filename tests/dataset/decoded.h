#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "dataset/footage/video_io.h"
#include "tests/dataset/clip_writer.h"

namespace mvstudio::testing {

/// What a clip of numbered frames gives.
struct Decoded {
  std::vector<int> codes;
  std::vector<int64_t> numbers;
  std::vector<double> times_s;
};

inline Decoded DecodeAll(dataset::VideoReader* reader) {
  Decoded decoded;
  while (const auto image = reader->Next()) {
    decoded.codes.push_back(ReadCode(*image));
    decoded.numbers.push_back(reader->frame_idx());
    decoded.times_s.push_back(reader->time_s());
  }
  return decoded;
}

}  // namespace mvstudio::testing
