#include "dataset/detect/tfjs/json_parse.h"

#include "core/json_view.h"

namespace mvstudio::detect::internal {

Json ParseJson(const std::string& path, const std::string& text) {
  constexpr size_t kMaxDepth = 64;
  return JsonFromText<Json>(text, {kMaxDepth, false}, path);
}

namespace {

int Base64Digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+') return 62;
  return c == '/' ? 63 : -1;
}

}  // namespace

std::string DecodeBase64(const std::string& path, const std::string& where, const std::string& text) {
  std::string bytes;
  const size_t padding = text.size() - std::min(text.size(), text.find_last_not_of('=') + 1);
  if (text.size() % 4 != 0 || padding > 2) throw FormatError(path, where, "is not base64");
  uint32_t bits = 0;
  int num_bits = 0;
  for (size_t i = 0; i + padding < text.size(); ++i) {
    const int digit = Base64Digit(text[i]);
    if (digit < 0) throw FormatError(path, where, "is not base64");
    bits = bits << 6 | static_cast<uint32_t>(digit);
    num_bits += 6;
    if (num_bits < 8) continue;
    num_bits -= 8;
    bytes += static_cast<char>(bits >> num_bits & 0xff);
  }
  return bytes;
}

}  // namespace mvstudio::detect::internal
