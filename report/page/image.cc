#include "report/page/image.h"

#include <cstdint>

#include "report/page/html.h"

namespace mvstudio::report {

std::string Base64(std::string_view bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t j = 0; j < 3; ++j) group = group << 8 | (i + j < bytes.size() ? static_cast<uint8_t>(bytes[i + j]) : 0u);
    for (size_t j = 0; j < 4; ++j) out += i + j > bytes.size() ? '=' : kDigits[group >> (18 - 6 * j) & 63];
  }
  return out;
}

std::string ImageType(std::string_view bytes) {
  if (bytes.substr(0, 8) == "\x89PNG\r\n\x1a\n") return "image/png";
  if (bytes.substr(0, 3) == "\xff\xd8\xff") return "image/jpeg";
  return {};
}

bool PngSize(std::string_view bytes, int* width, int* height) {
  if (ImageType(bytes) != "image/png" || bytes.size() < 24) return false;
  const auto big_endian = [&](size_t at) {
    uint32_t value = 0;
    for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<uint8_t>(bytes[at + i]);
    return value;
  };
  const uint32_t w = big_endian(16), h = big_endian(20);
  if (w == 0 || h == 0 || w > 1000000 || h > 1000000) return false;
  *width = static_cast<int>(w);
  *height = static_cast<int>(h);
  return true;
}

std::string ImageUri(std::string_view bytes) { return "data:" + ImageType(bytes) + ";base64," + Base64(bytes); }

std::string ImageHtml(std::string_view bytes, const std::string& alt) {
  std::string size;
  int width = 0, height = 0;
  if (PngSize(bytes, &width, &height)) {
    size = " width=\"" + std::to_string(width) + "\" height=\"" + std::to_string(height) + "\"";
  }
  return "<img alt=\"" + EscapeHtml(alt) + "\"" + size + " src=\"" + ImageUri(bytes) + "\">";
}

}  // namespace mvstudio::report
