#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>

#include "core/disk/files.h"
#include "core/image.h"
#include "core/random.h"
#include "dataset/pose/pose3d.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test_data.h"

namespace mvstudio::dataset {

inline std::string DataFolder(const std::string& set) { return mvstudio::testing::DataRoot() + "/" + set; }

inline Image RandomImage(int width, int height, int channels, uint64_t seed) {
  Image image(width, height, channels);
  Rng rng(seed);
  for (uint8_t& p : image.pixels) p = static_cast<uint8_t>(rng.Index(256));
  return image;
}

/// Smooth in space: what a lossy codec keeps.
inline Image SmoothImage(int width, int height, double phase) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      uint8_t* p = image.Pixel(x, y);
      p[0] = static_cast<uint8_t>(128 + 90 * std::sin(0.05 * x + phase));
      p[1] = static_cast<uint8_t>(128 + 90 * std::sin(0.04 * y - phase));
      p[2] = static_cast<uint8_t>(128 + 90 * std::cos(0.03 * (x + y) + phase));
    }
  }
  return image;
}

/// A person who stands at (x, 0, 0), arms a little spread, 1.75 m tall.
inline Coco19Pose StandingPerson(double x_m) {
  const double joints[19][3] = {{0, 0, 1.45},       {0, -0.1, 1.6},  {0, 0, 0.95},        {0.18, 0, 1.42}, {0.34, 0, 1.2},
                                {0.48, 0, 1.0},     {0.1, 0, 0.93},  {0.14, 0, 0.5},      {0.16, 0, 0.1},  {-0.18, 0, 1.42},
                                {-0.34, 0, 1.2},    {-0.48, 0, 1.0}, {-0.1, 0, 0.93},     {-0.14, 0, 0.5}, {-0.16, 0, 0.1},
                                {0.03, -0.1, 1.64}, {0.07, 0, 1.62}, {-0.03, -0.1, 1.64}, {-0.07, 0, 1.62}};
  Coco19Pose pose;
  for (int j = 0; j < 19; ++j) {
    pose.x_in_world.col(j) << joints[j][0] + x_m, joints[j][1], joints[j][2];
    pose.valid[j] = true;
    pose.confidence[j] = 1;
  }
  return pose;
}

inline double MeanAbsDifference(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(int{a.pixels[i]} - int{b.pixels[i]});
  return sum / static_cast<double>(a.pixels.size());
}

inline void Truncate(const std::string& from, const std::string& to, double fraction) {
  const std::string all = ReadFile(from);
  std::ofstream(to, std::ios::binary) << all.substr(0, static_cast<size_t>(fraction * static_cast<double>(all.size())));
}

}  // namespace mvstudio::dataset
