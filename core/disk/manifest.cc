#include "core/disk/manifest.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <mutex>
#include <set>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/manifest_write.h"
#include "core/disk/parents.h"
#include "core/disk/system_calls.h"
#include "core/disk/temporary.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/parallel.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

constexpr size_t kMostNamed = 8;

struct Writer {
  std::mutex mutex;
  std::string command, version;
};

Writer& ThisWriter() {
  static auto* writer = new Writer;
  return *writer;
}

uid_t OwnerOf(const std::string& path) {
  struct stat info {};
  return lstat(path.c_str(), &info) == 0 ? info.st_uid : static_cast<uid_t>(-1);
}

/// The manifests of all folders that were asked about, as far as they may speak for what lies at or below `top`. One in a
/// folder above does when it holds the folder that is asked about as well, or when that folder is a part of an output of this
/// process: else whoever writes beside a folder could make its files ours. One of another user speaks for his files alone.
class Ledger {
 public:
  explicit Ledger(std::string top)
      : top_(std::move(top)), folder_(fs::is_directory(fs::symlink_status(top_)) ? top_ : internal::ParentOf(top_)) {
    if (folder_ == "/") folder_.clear();
  }
  /// Whether a manifest of a folder that the path lies in lists it with this digest.
  bool Lists(const std::string& path, const FileDigest& digest) {
    bool listed = false;
    ForEach(path, [&](const ManifestEntry& entry) {
      listed = listed || entry.now == digest || (entry.before && *entry.before == digest);
    });
    return listed;
  }
  bool ListsName(const std::string& path) {
    bool listed = false;
    ForEach(path, [&](const ManifestEntry&) { listed = true; });
    return listed;
  }

 private:
  template <class Use>
  void ForEach(const std::string& path, const Use& use) {
    for (size_t slash = path.rfind('/', path.size() - 2); slash != std::string::npos;) {
      const Listed& listed = Of(path.substr(0, slash));
      const auto entry = listed.manifest.files.find(path.substr(slash + 1));
      if (entry != listed.manifest.files.end() && MaySpeak(listed, path)) use(entry->second);
      if (slash == 0) return;
      slash = path.rfind('/', slash - 1);
    }
  }

  struct Listed {
    Manifest manifest;
    bool here = true;  // of a folder whose list counts
    uid_t owner = 0;
  };

  static bool MaySpeak(const Listed& listed, const std::string& path) {
    constexpr uid_t kRoot = 0;
    return listed.here && (listed.owner == geteuid() || listed.owner == kRoot || listed.owner == OwnerOf(path));
  }

  bool IsHere(const std::string& folder, const Manifest& manifest) const {
    if (folder.compare(0, folder_.size(), folder_) == 0 || internal::InLockedOutput(folder)) return true;
    return manifest.files.count(folder_.substr(folder.size() + 1) + "/") > 0;
  }

  const Listed& Of(const std::string& folder) {
    const auto found = manifests_.find(folder);
    if (found != manifests_.end()) return found->second;
    Listed listed;
    try {
      listed.manifest = ReadManifest(folder.empty() ? "/" : folder).value_or(Manifest());
    } catch (const FormatError&) {  // damaged or foreign: it lists nothing
    } catch (const IoError&) {      // what cannot be read says nothing about whose the files beside it are
      if (folder.compare(0, top_.size(), top_) == 0) throw;
    }
    listed.owner = OwnerOf(folder + "/" + kManifestName);
    listed.here = IsHere(folder, listed.manifest);
    return manifests_[folder] = std::move(listed);
  }

  std::string top_, folder_;
  std::map<std::string, Listed> manifests_;
};

/// Everything below `path` that has to be compared with the manifests; what cannot be ours goes to `in_the_way` at once.
struct Inventory {
  std::vector<std::string> files, folders, in_the_way;

  void Walk(const std::string& path, Ledger* ledger) {
    struct stat info {};
    if (lstat(path.c_str(), &info) != 0) {
      if (errno != ENOENT && errno != ENOTDIR) internal::ThrowErrno(path, "cannot look at it", errno);
      return;
    }
    const std::string name = path.substr(path.rfind('/') + 1);
    if (internal::IsTemporaryHere(path)) return;
    if (S_ISDIR(info.st_mode)) return WalkFolder(path, ledger);
    if (name == kManifestName && IsManifest(path)) {
      files.push_back(path);
    } else if (S_ISREG(info.st_mode) || S_ISLNK(info.st_mode)) {
      (ledger->ListsName(path) ? files : in_the_way).push_back(path);
    } else {
      in_the_way.push_back(path);
    }
  }

  void WalkFolder(const std::string& path, Ledger* ledger) {
    bool empty = true;
    internal::SweepLeftovers(path);
    for (const auto& entry : fs::directory_iterator(path)) {
      empty = false;
      Walk(entry.path().string(), ledger);
    }
    folders.push_back(path);
    if (empty && path != top && !ledger->ListsName(path + "/")) in_the_way.push_back(path + "/");
  }

  static bool IsManifest(const std::string& path) {
    try {
      return ReadManifest(internal::ParentOf(path)).has_value();
    } catch (const FormatError&) {
      return false;
    }
  }

  std::string top;
};

/// Those of `files` that are not as the manifests say.
void Compare(const std::vector<std::string>& files, Ledger* ledger, std::vector<std::string>* in_the_way) {
  std::vector<FileDigest> digests(files.size());
  ParallelFor(static_cast<int64_t>(files.size()), 0, [&](int64_t i) {
    if (fs::path(files[i]).filename() != kManifestName) digests[i] = KnownDigest(files[i]);
  });
  for (size_t i = 0; i < files.size(); ++i) {
    const bool record = fs::path(files[i]).filename() == kManifestName;
    if (!record && !ledger->Lists(files[i], digests[i])) in_the_way->push_back(files[i]);
  }
}

Inventory InventoryOf(const std::string& path) {
  Inventory inventory;
  inventory.top = internal::Normal(path);
  Ledger ledger(inventory.top);
  inventory.Walk(inventory.top, &ledger);
  Compare(inventory.files, &ledger, &inventory.in_the_way);
  std::sort(inventory.in_the_way.begin(), inventory.in_the_way.end());
  return inventory;
}

void RequireNothing(const std::vector<std::string>& in_the_way) {
  if (in_the_way.empty()) return;
  std::string names;
  for (size_t i = 0; i < std::min(in_the_way.size(), kMostNamed); ++i) names += (i ? ", " : "") + in_the_way[i];
  if (in_the_way.size() > kMostNamed) names += " and " + std::to_string(in_the_way.size() - kMostNamed) + " more";
  throw UsageError("in the way, not written by mvstudio or changed since: " + names +
                   "; nothing was touched: move them elsewhere or choose another option 'out'");
}

void RemoveFile(const std::string& path) {
  if (!internal::Allowed("remove", path) || (unlink(path.c_str()) != 0 && errno != ENOENT))
    internal::ThrowErrno(path, "cannot remove", errno);
}

}  // namespace

void SetWriterName(const std::string& command, const std::string& version) {
  const std::lock_guard<std::mutex> guard(ThisWriter().mutex);
  ThisWriter().command = command, ThisWriter().version = version;
}

std::pair<std::string, std::string> WriterName() {
  const std::lock_guard<std::mutex> guard(ThisWriter().mutex);
  return {ThisWriter().command, ThisWriter().version};
}

std::optional<Manifest> ReadManifest(const std::string& folder) {
  const std::string path = folder + "/" + kManifestName;
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) return std::nullopt;
  if (!S_ISREG(info.st_mode)) throw FormatError(path, "", "is no file; move it elsewhere");
  return ManifestFromJsonText(ReadFile(path), path);
}

std::string WriterOf(const std::string& path) {
  const std::string normal = internal::Normal(path);
  for (std::string folder = internal::ParentOf(normal);; folder = internal::ParentOf(folder)) {
    const std::optional<Manifest> manifest = ReadManifest(folder);
    if (manifest) {
      const auto entry = manifest->files.find(normal.substr(folder == "/" ? 1 : folder.size() + 1));
      if (entry != manifest->files.end()) return entry->second.by.empty() ? manifest->command : entry->second.by;
    }
    if (folder == "/") return "";
  }
}

std::vector<std::string> FilesInTheWay(const std::string& path) { return InventoryOf(path).in_the_way; }

void RequireOurs(const std::vector<std::string>& paths) {
  std::vector<std::string> all;
  for (const std::string& path : paths) {
    const std::vector<std::string> some = FilesInTheWay(path);
    all.insert(all.end(), some.begin(), some.end());
  }
  RequireNothing(all);
}

void RemoveOurs(const std::vector<std::string>& paths) {
  std::vector<Inventory> inventories;
  std::vector<std::string> in_the_way;
  for (const std::string& path : paths) {
    inventories.push_back(InventoryOf(path));
    const auto& found = inventories.back().in_the_way;
    in_the_way.insert(in_the_way.end(), found.begin(), found.end());
  }
  RequireNothing(in_the_way);
  for (const Inventory& inventory : inventories) {
    // A manifest goes with its folder, the outermost last: were this cut, what is left is still known to be ours.
    std::set<std::string> records;
    for (const std::string& file : inventory.files) {
      if (fs::path(file).filename() == kManifestName)
        records.insert(file);
      else
        RemoveFile(file);
    }
    for (const std::string& folder : inventory.folders) {
      const std::string record = folder + "/" + kManifestName;
      if (records.erase(record)) RemoveFile(record);
      if (!internal::Allowed("remove", folder) || (rmdir(folder.c_str()) != 0 && errno != ENOENT && errno != ENOTEMPTY))
        internal::ThrowErrno(folder, "cannot remove the folder", errno);
    }
    for (const std::string& record : records) RemoveFile(record);  // a path that is a manifest itself
  }
}

}  // namespace mvstudio
