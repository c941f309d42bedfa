#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "core/image.h"

/// What stands behind a rendered person.
namespace mvstudio::avatar {

/// Nothing (pictures keep their opacity), one colour, or a picture that fills the frame.
class Backdrop {
 public:
  /// "" or "none"; a colour: black, white, grey, green, #rgb, #rrggbb or r,g,b in 0..255; else the path of a PNG or JPEG.
  /// Throws UsageError, IoError, FormatError.
  explicit Backdrop(const std::string& text);

  bool transparent() const { return transparent_; }
  /// `premultiplied`: RGBA with colours multiplied by opacity. Returns RGB, colour + (1 - opacity) backdrop (Shysheya et al.:
  /// sum_k P_k T_k + P_0 B); RGBA with plain colours where there is no backdrop. A picture is scaled to cover the frame and cut
  /// at its sides.
  Image Under(const Image& premultiplied) const;

 private:
  const Image& Covering(int width, int height) const;

  bool transparent_ = false;
  std::array<uint8_t, 3> colour_{};
  Image picture_;
  mutable std::map<std::pair<int, int>, Image> covering_;
};

}  // namespace mvstudio::avatar
