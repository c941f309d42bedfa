#include <filesystem>

#include "core/hash/sha256.h"
#include "core/label.h"
#include "dataset/session/session.h"

namespace mvstudio::dataset {
namespace {

constexpr size_t kMaxNameBytes = 128, kMaxSlugBytes = 80;

bool IsPlain(unsigned char c) {
  return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '.' || c == '_' || c == '-';
}

}  // namespace

std::string WhyNotAName(const std::string& name) {
  const std::string why = WhyNotALabel(name, kMaxNameBytes);
  if (!why.empty()) return why;
  if (name == "." || name == "..") return "is a folder's own name";
  const size_t at = name.find_first_of("/\\=");
  return at == std::string::npos ? "" : std::string("holds '") + name[at] + "'";
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
