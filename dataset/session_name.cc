#include <filesystem>

#include "core/error.h"
#include "core/sha256.h"
#include "core/utf8.h"
#include "dataset/session.h"

namespace mvstudio::dataset {
namespace {

constexpr size_t kMaxNameBytes = 128, kMaxSlugBytes = 80;

bool IsPlain(unsigned char c) {
  return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '.' || c == '_' || c == '-';
}

}  // namespace

std::string WhyNotAName(const std::string& name) {
  if (name.empty()) return "is empty";
  if (name.size() > kMaxNameBytes) return "is longer than " + std::to_string(kMaxNameBytes) + " bytes";
  if (name == "." || name == "..") return "is a folder's own name";
  for (size_t at = 0; at < name.size();) {
    const size_t length = Utf8Length(name, at);
    if (length == 0) return "is not UTF-8";
    const unsigned char c = static_cast<unsigned char>(name[at]);
    if (c < 0x20 || c == 0x7f || (c == 0xc2 && static_cast<unsigned char>(name[at + 1]) < 0xa0)) {
      return "holds a control character";
    }
    if (c == '/' || c == '\\' || c == '=') return std::string("holds '") + name[at] + "'";
    at += length;
  }
  return "";
}

std::string Slug(const std::string& name) {
  std::string slug;
  for (const char c : name) slug += IsPlain(static_cast<unsigned char>(c)) ? c : '_';
  if (!slug.empty() && (slug[0] == '-' || slug[0] == '.')) slug[0] = '_';
  if (slug == name && !slug.empty() && slug.size() <= kMaxSlugBytes) return slug;
  const std::string digest = Sha256Hex(name.data(), name.size()).substr(0, 8);
  return (slug.empty() ? "_" : slug.substr(0, kMaxSlugBytes - 9)) + "-" + digest;
}

}  // namespace mvstudio::dataset
