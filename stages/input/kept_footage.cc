#include "stages/input/kept_footage.h"

#include "core/format.h"
#include "core/hash/sha256.h"
#include "stages/input/fingerprint.h"

namespace mvstudio::stages {
namespace {

/// The fingerprint that was kept of a path; empty where none is.
Fingerprint KeptPrint(const KeptResults& kept, const std::string& key, const std::string& path) {
  Fingerprint print;
  print.path = path;
  const std::optional<std::string> bytes = kept.Load(key);
  if (!bytes) return print;
  try {
    KeptReader in(*bytes);
    print.files = in.Get<uint64_t>(), print.bytes = in.Get<uint64_t>();
    print.stamp = in.Text(), print.sha256 = in.Text();
    if (!in.AtEnd()) throw DamagedBytes();
  } catch (const DamagedBytes&) {
    kept.Damaged(key);
    print = {};
    print.path = path;
  }
  return print;
}

}  // namespace

std::optional<std::string> FootageDigest(const CachePlace& cache, const std::string& path) {
  const KeptResults kept(cache, "digests");
  const std::string key = Sha256Hex(path.data(), path.size());
  const Fingerprint before = KeptPrint(kept, key, path), now = FingerprintOf(path, &before);
  if (now.files == 0 || !now.error.empty()) return std::nullopt;
  if (now.stamp != before.stamp) {
    KeptWriter out;
    out.Put<uint64_t>(now.files), out.Put<uint64_t>(now.bytes);
    out.Put(now.stamp), out.Put(now.sha256);
    kept.Store(key, out.Take());
  }
  return now.sha256.empty() ? now.stamp : now.sha256;
}

std::string BlockKey(const std::string& base, int64_t block) {
  return base + "/" + Format("%06lld", static_cast<long long>(block));
}

void PutImage(const Image& image, KeptWriter* out) {
  out->Put<int32_t>(image.width), out->Put<int32_t>(image.height), out->Put<int32_t>(image.channels);
  out->PutAll(image.pixels.data(), image.pixels.size());
}

Image GetImage(KeptReader* in) {
  Image image;
  image.width = in->Get<int32_t>(), image.height = in->Get<int32_t>(), image.channels = in->Get<int32_t>();
  image.pixels = in->All<uint8_t>();
  if (image.width < 0 || image.height < 0 || image.channels < 0 ||
      image.pixels.size() != size_t(image.width) * size_t(image.height) * size_t(image.channels))
    throw DamagedBytes();
  return image;
}

}  // namespace mvstudio::stages
