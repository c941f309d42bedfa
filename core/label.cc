#include "core/label.h"

#include "core/utf8.h"

namespace mvstudio {

std::string WhyNotALabel(std::string_view name, size_t max_bytes) {
  if (name.empty()) return "is empty";
  if (name.size() > max_bytes) return "is longer than " + std::to_string(max_bytes) + " bytes";
  for (size_t at = 0, length = 0; at < name.size(); at += length) {
    length = Utf8Length(name, at);
    if (length == 0) return "is not UTF-8";
    const auto byte = static_cast<unsigned char>(name[at]);
    const bool is_c1 = byte == 0xc2 && static_cast<unsigned char>(name[at + 1]) < 0xa0;
    if (byte < 0x20 || byte == 0x7f || is_c1) return "holds a control character";
  }
  return "";
}

}  // namespace mvstudio
