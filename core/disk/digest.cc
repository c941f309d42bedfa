#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <mutex>
#include <tuple>

#include "core/disk/manifest.h"
#include "core/hash/sha256.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

/// What tells a file and its content from others: names may change.
struct Stamp {
  explicit Stamp(const struct stat& info)
      : device(info.st_dev),
        inode(info.st_ino),
        size(info.st_size),
        seconds(info.st_mtim.tv_sec),
        nanoseconds(info.st_mtim.tv_nsec) {}
  bool operator<(const Stamp& o) const {
    return std::tie(device, inode, size, seconds, nanoseconds) < std::tie(o.device, o.inode, o.size, o.seconds, o.nanoseconds);
  }
  dev_t device;
  ino_t inode;
  off_t size;
  time_t seconds;
  long nanoseconds;
};

struct KnownFiles {
  std::mutex mutex;
  std::map<Stamp, FileDigest> digests;
};

KnownFiles& AllKnown() {
  static auto* known = new KnownFiles;
  return *known;
}

void Remember(const Stamp& stamp, const FileDigest& digest) {
  constexpr size_t kMost = 200000;
  KnownFiles& known = AllKnown();
  const std::lock_guard<std::mutex> guard(known.mutex);
  if (known.digests.size() >= kMost) known.digests.clear();
  known.digests.insert_or_assign(stamp, digest);
}

}  // namespace

FileDigest DigestOf(const std::string& path) {
  std::error_code error;
  if (fs::is_symlink(fs::symlink_status(path, error))) {
    const std::string target = fs::read_symlink(path).string();
    return {target.size(), Sha256Hex(target.data(), target.size())};
  }
  return {fs::file_size(path), Sha256File(path)};
}

FileDigest KnownDigest(const std::string& path) {
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) return DigestOf(path);
  const Stamp stamp(info);
  {
    KnownFiles& known = AllKnown();
    const std::lock_guard<std::mutex> guard(known.mutex);
    const auto found = known.digests.find(stamp);
    if (found != known.digests.end()) return found->second;
  }
  const FileDigest digest = DigestOf(path);
  Remember(stamp, digest);  // of before: a file that is written to meanwhile has another stamp afterwards
  return digest;
}

}  // namespace mvstudio
