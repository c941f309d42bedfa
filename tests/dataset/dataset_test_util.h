#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/files.h"
#include "core/image.h"
#include "core/random.h"

namespace mvstudio::dataset {

/// A folder of the running test's own, removed at its end.
class TestFolder {
 public:
  TestFolder() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    path_ = (std::filesystem::temp_directory_path() /
             ("mvstudio_" + std::string(info->test_suite_name()) + "_" + info->name() + "_" + std::to_string(getpid()))).string();
    std::filesystem::remove_all(path_);
    MakeFolder(path_);
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// Folder of real recordings, or "" when the set is not there.
inline std::string DataFolder(const std::string& set) {
  const char* data = std::getenv("MVSTUDIO_DATA");
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  const std::string root = data ? data : std::string(source ? source : ".") + "/../shared/data";
  const std::string path = root + "/" + set;
  return std::filesystem::exists(path) ? path : "";
}

#define MVS_DATA_OR_SKIP(variable, set)            \
  const std::string variable = DataFolder(set);    \
  if (variable.empty()) GTEST_SKIP() << "data set " << set << " is not there"

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
