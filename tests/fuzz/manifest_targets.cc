#include "core/disk/manifest.h"
#include "tests/fuzz/fuzz.h"

/// The list of what this program wrote into a folder: who can change it must not get other files removed.
namespace mvstudio::fuzz {
namespace {

bool IsDigest(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

/// Relative, without a part that leads out of the folder.
bool StaysInside(std::string path) {
  if (!path.empty() && path.back() == '/') path.pop_back();
  if (path.empty() || path.find('\0') != std::string::npos) return false;
  path += '/';
  for (size_t begin = 0; begin < path.size();) {
    const size_t end = path.find('/', begin);
    const std::string part = path.substr(begin, end - begin);
    if (part.empty() || part == "." || part == "..") return false;
    begin = end + 1;
  }
  return true;
}

}  // namespace

MVS_FUZZ_TARGET(manifest, bytes) {
  Manifest manifest;
  if (!Accepts([&] { manifest = ManifestFromJsonText(bytes, ".mvstudio.json"); })) return;
  for (const auto& [path, entry] : manifest.files) {
    Require(StaysInside(path), "a file outside the folder: " + path);
    Require(path.back() == '/' || IsDigest(entry.now.sha256), "a file without a digest: " + path);
    Require(!entry.before || IsDigest(entry.before->sha256), "a digest that is none: " + path);
  }
  const std::string text = ManifestToJsonText(manifest);
  std::string again;
  Require(Accepts([&] { again = ManifestToJsonText(ManifestFromJsonText(text, "again")); }), "what was written cannot be read");
  Require(again == text, "the manifest changes when it is read and written again");
}

}  // namespace mvstudio::fuzz
