#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

/// Writes C3D files of every kind for tests: integers and floats, three processors.
namespace mvstudio::dataset {

struct C3dSample {
  int processor = 84;  // Intel; 85: DEC, 86: MIPS
  bool floats = true;
  double scale = 0.1;  // of integers, and of floats with a minus
  std::string units = "mm", y_screen = "+Z";
  int first = 1, analog_per_frame = 0;
  std::vector<std::string> labels = {"a", "b"};
  std::vector<std::pair<std::string, std::vector<std::string>>> lists;  // more of the group POINT: ANGLES, …
  bool rotations = false;                                               // a group ROTATION and its data behind the points
  std::vector<std::vector<double>> frames;                              // x, y, z, residual of every point

  std::string Bytes() const {
    const std::string parameters = Parameters();
    std::string bytes = Header(2 + parameters.size() / 512) + parameters;
    for (const std::vector<double>& frame : frames) {
      for (size_t i = 0; i < frame.size(); ++i) {
        if (floats) {
          bytes += Float(frame[i]);
        } else {
          bytes += Word(static_cast<int>(std::lround(i % 4 == 3 ? frame[i] : frame[i] / scale)));
        }
      }
      for (int k = 0; k < analog_per_frame; ++k) bytes += floats ? Float(7) : Word(7);
    }
    bytes.resize((bytes.size() + 511) / 512 * 512, '\0');
    if (rotations) bytes += std::string(4096, '\1');
    return bytes;
  }

  std::string Word(int value) const {
    const char low = static_cast<char>(value & 0xff), high = static_cast<char>(value >> 8 & 0xff);
    return processor == 86 ? std::string{high, low} : std::string{low, high};
  }

  std::string Float(double value) const {
    uint32_t bits = 0;
    if (processor == 85) {
      int exponent = 0;
      const double fraction = std::frexp(std::abs(value), &exponent);  // in [0.5, 1), DEC's own range
      if (value != 0) {
        bits =
            static_cast<uint32_t>(exponent + 128) << 23 | (static_cast<uint32_t>(std::lround(fraction * 16777216)) & 0x7fffff);
        bits |= value < 0 ? 0x80000000u : 0;
      }
      return Word(static_cast<int>(bits >> 16)) + Word(static_cast<int>(bits & 0xffff));
    }
    const float single = static_cast<float>(value);
    std::memcpy(&bits, &single, 4);
    const int high = static_cast<int>(bits >> 16), low = static_cast<int>(bits & 0xffff);
    return processor == 86 ? Word(high) + Word(low) : Word(low) + Word(high);
  }

 private:
  std::string Header(size_t data_block) const {
    const int count = static_cast<int>(frames.empty() ? labels.size() : frames[0].size() / 4);
    std::string bytes = "\x02\x50" + Word(count) + Word(analog_per_frame) + Word(first);
    bytes += Word(first + static_cast<int>(frames.size()) - 1) + Word(0) + Float(floats ? -scale : scale);
    bytes += Word(static_cast<int>(data_block)) + Word(1) + Float(100);
    bytes.resize(512, '\0');
    return bytes;
  }
  std::string Entry(int group, const std::string& name, const std::string& content) const {
    return std::string{static_cast<char>(name.size()), static_cast<char>(group)} + name +
           Word(static_cast<int>(content.size()) + 2) + content;
  }
  std::string Text(const std::string& name, const std::vector<std::string>& texts) const {
    size_t longest = 1;
    for (const std::string& text : texts) longest = std::max(longest, text.size());
    std::string content{'\xff', 2, static_cast<char>(longest), static_cast<char>(texts.size())};
    for (std::string text : texts) text.resize(longest, ' '), content += text;
    return Entry(1, name, content + '\0');
  }
  std::string Parameters() const {
    std::string entries = Entry(-1, "POINT", std::string(1, '\0')) + Text("LABELS", labels);
    if (!units.empty()) entries += Text("UNITS", {units});
    entries += Text("Y_SCREEN", {y_screen});
    for (const auto& [name, texts] : lists) entries += Text(name, texts);
    if (rotations) {
      const size_t width = floats ? 4 : 2, points = frames.empty() ? 0 : width * (frames[0].size() + analog_per_frame);
      const size_t block = 4 + (points * frames.size() + 511) / 512;  // behind a header, two blocks of parameters, the points
      entries += Entry(-2, "ROTATION", std::string(1, '\0')) + Entry(2, "LABELS", std::string{'\xff', 1, 6} + "pelvis" + '\0');
      entries += Entry(2, "DATA_START", std::string{2, 0} + Word(static_cast<int>(block)) + '\0');
      entries.resize(std::max<size_t>(entries.size(), 600), '\0');
    }
    const size_t blocks = (4 + entries.size() + 2 + 511) / 512;
    std::string bytes{1, 0x50, static_cast<char>(blocks), static_cast<char>(processor)};
    bytes += entries;
    bytes.resize(512 * blocks, '\0');
    return bytes;
  }
};

}  // namespace mvstudio::dataset
