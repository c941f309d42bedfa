#include "core/disk/kept.h"

#include <cstdlib>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/log.h"

namespace mvstudio {
namespace {

constexpr size_t kDigestSize = 64;
constexpr char kAuto[] = "auto", kOff[] = "off";

/// "off" or a folder.
std::string FromEnvironment() {
  const auto get = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value ? value : "");
  };
  if (const std::string chosen = get("MVSTUDIO_CACHE"); !chosen.empty()) return chosen;
  if (const std::string cache = get("XDG_CACHE_HOME"); !cache.empty()) return cache + "/mvstudio";
  const std::string home = get("HOME");
  return home.empty() ? kOff : home + "/.cache/mvstudio";
}

}  // namespace

CachePlace CacheIn(const std::string& folder) { return {CachePlace::Kind::kFolder, folder}; }

std::string ToString(const CachePlace& place) {
  if (place.kind == CachePlace::Kind::kFolder) return place.folder;
  return place.kind == CachePlace::Kind::kAuto ? kAuto : kOff;
}

void FromString(const std::string& text, CachePlace* place) {
  if (text.empty()) throw UsageError("option 'cache' needs auto, off or a folder");
  *place = CacheIn(text);
  if (text == kAuto) *place = {CachePlace::Kind::kAuto, ""};
  if (text == kOff) *place = {CachePlace::Kind::kOff, ""};
}

KeptResults::KeptResults(const CachePlace& place, const std::string& kind) : kind_(kind) {
  const std::string chosen = place.kind == CachePlace::Kind::kAuto ? FromEnvironment() : ToString(place);
  if (chosen != kOff) folder_ = chosen + "/" + kind;
}

std::optional<std::string> KeptResults::Load(const std::string& key) const {
  if (!Has(key)) return std::nullopt;
  const UntracedScope untraced;
  try {
    std::string bytes = ReadFile(PathOf(key));
    const size_t size = bytes.size() - std::min(bytes.size(), kDigestSize);
    if (Sha256Hex(bytes.data(), size) == bytes.substr(size)) return bytes.erase(size);
    Damaged(key);
  } catch (const Error& error) {
    Log(LogLevel::kWarning, std::string("kept ") + kind_ + " cannot be read: " + error.what());
  }
  return std::nullopt;
}

bool KeptResults::Has(const std::string& key) const {
  std::error_code ignored;
  return enabled() && std::filesystem::is_regular_file(PathOf(key), ignored);
}

void KeptResults::Store(const std::string& key, std::string bytes) const {
  if (!enabled()) return;
  const UntracedScope untraced;
  try {
    bytes += Sha256Hex(bytes.data(), bytes.size());
    WriteFileAtomic(PathOf(key), bytes);
  } catch (const std::exception& error) {
    Log(LogLevel::kWarning, kind_ + " are not kept: " + error.what());
  }
}

void KeptResults::Remove(const std::string& key) const {
  std::error_code ignored;
  if (!enabled()) return;
  const UntracedScope untraced;
  try {
    if (Has(key)) return RemoveOurs({PathOf(key)});
    if (std::filesystem::is_directory(folder_ + "/" + key, ignored)) RemoveOurs({folder_ + "/" + key});
  } catch (const std::exception& error) {
    Log(LogLevel::kWarning, kind_ + " stay in the cache: " + error.what());
  }
}

void KeptResults::Damaged(const std::string& key) const {
  Log(LogLevel::kWarning, PathOf(key) + " is damaged and will be made anew");
}

}  // namespace mvstudio
