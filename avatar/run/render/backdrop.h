#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "core/image.h"

/// The background of a rendered person.
namespace mvstudio::avatar {

/// Nothing (images keep their opacity), one colour, or an image that fills the frame.
class Backdrop {
 public:
  /// "" or "none"; a colour: black, white, grey, green, #rgb, #rrggbb or r,g,b in 0..255; else the path of a PNG or JPEG.
  /// Throws UsageError, IoError, FormatError.
  explicit Backdrop(const std::string& text);

  bool transparent() const { return transparent_; }
  /// `premultiplied`: RGBA with colours multiplied by opacity. Returns RGB, colour + (1 - opacity) backdrop (Shysheya et
  /// al.: sum_k P_k T_k + P_0 B), or RGBA with plain colours without a backdrop. A backdrop image is scaled to cover the
  /// frame and cropped at its sides.
  Image Under(const Image& premultiplied) const;

 private:
  const Image& Covering(int width, int height) const;

  bool transparent_ = false;
  std::array<uint8_t, 3> colour_{};
  Image image_;
  mutable std::map<std::pair<int, int>, Image> covering_;
};

}  // namespace mvstudio::avatar
