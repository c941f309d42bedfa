#include "stages/input/fingerprint.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/disk/manifest.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/hash/sha256.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

constexpr uintmax_t kMaxHashedBytes = 2ull << 30;

struct Found {
  std::vector<std::string> files;
  uintmax_t bytes = 0;
  bool links = false;  ///< to folders, which are not followed
  size_t num_faults = 0;
  std::string first_fault;

  void AddFault(const std::string& path, const std::string& what) {
    if (num_faults++ == 0) first_fault = path + ": " + what;
  }
};

/// Regular files alone: opening a pipe would wait for its writer, or take what was meant for somebody else.
void AddFile(const std::string& path, Found* found) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (error) return found->AddFault(path, error.message());
  if (!fs::is_regular_file(status)) return;
  const uintmax_t size = fs::file_size(path, error);
  if (error) return found->AddFault(path, error.message());
  found->files.push_back(path);
  found->bytes += size;
}

bool IsRecord(const std::string& name) {
  constexpr std::string_view kEnd = ".result.json";
  return name.compare(0, 9, ".mvstudio") == 0 || name == "provenance.jsonl" ||
         (name.size() > kEnd.size() && name.compare(name.size() - kEnd.size(), kEnd.size(), kEnd) == 0);
}

void AddFolder(const std::string& path, Found* found) {
  std::error_code error;
  fs::recursive_directory_iterator at(path, error), end;
  if (error) return found->AddFault(path, error.message());
  while (at != end) {
    const std::string name = at->path().string();
    if (at->is_directory(error) && !at->is_symlink(error)) {
      if (access(name.c_str(), R_OK | X_OK) != 0) {
        found->AddFault(name, std::generic_category().message(errno));
        at.disable_recursion_pending();
      }
    } else if (fs::is_directory(name, error)) {
      found->links = true;
    } else if (!IsRecord(at->path().filename().string())) {
      AddFile(name, found);
    }
    at.increment(error);
    if (error) return found->AddFault(name, error.message());
  }
  std::sort(found->files.begin(), found->files.end());
}

Found Find(const std::string& path) {
  Found found;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) {
    AddFolder(path, &found);
  } else if (fs::is_regular_file(status)) {
    AddFile(path, &found);
  } else if (fs::exists(status)) {
    found.AddFault(path, "no regular file, not read");
  } else if (IsPattern(path)) {
    for (const std::string& file : FilesMatching(path)) AddFile(file, &found);
  } else {
    found.AddFault(path, error ? error.message() : "not there");
  }
  return found;
}

std::string NameIn(const std::string& path, const std::string& file) { return file.substr(std::min(path.size(), file.size())); }

bool IsFile(const std::string& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

/// Of what is behind a link, not of its name.
std::string ContentDigest(const std::string& file) {
  return KnownDigest(fs::is_symlink(file) ? fs::canonical(file).string() : file).sha256;
}

std::string DigestOfList(const std::string& path, const std::vector<std::string>& files) {
  Sha256 all;
  for (const std::string& file : files) {
    const std::string line = ContentDigest(file) + " " + NameIn(path, file) + "\n";
    all.Update(line.data(), line.size());
  }
  return all.HexDigest();
}

std::string StampOf(const std::string& path, const std::vector<std::string>& files, int64_t* newest_ns) {
  Sha256 all;
  for (const std::string& file : files) {
    struct stat info {};
    if (stat(file.c_str(), &info) != 0) return "";
    *newest_ns = std::max<int64_t>(*newest_ns, int64_t{1000000000} * info.st_mtim.tv_sec + info.st_mtim.tv_nsec);
    const std::string line = std::to_string(info.st_size) + " " + std::to_string(info.st_mtim.tv_sec) + "." +
                             std::to_string(info.st_mtim.tv_nsec) + " " + NameIn(path, file) + "\n";
    all.Update(line.data(), line.size());
  }
  return all.HexDigest();
}

std::string FaultText(const Found& found) {
  const std::string others = std::to_string(found.num_faults - 1);
  return found.first_fault + (found.num_faults > 1 ? " (and " + others + " more)" : "");
}

void AddDigests(const Found& found, const Fingerprint* earlier, Fingerprint* print) {
  print->stamp = StampOf(print->path, found.files, &print->newest_ns);
  if (earlier && !print->stamp.empty() && earlier->stamp == print->stamp) {
    print->sha256 = earlier->sha256;
  } else if (found.bytes <= kMaxHashedBytes) {
    print->sha256 = IsFile(print->path) ? ContentDigest(print->path) : DigestOfList(print->path, found.files);
  }
}

/// What was found last: provenance and what is kept beside it ask for one path after the other, and a take has very many files.
class LastFound {
 public:
  std::optional<Fingerprint> Of(const std::string& place) {
    const std::lock_guard<std::mutex> guard(mutex_);
    const auto found = prints_.find(place);
    return found == prints_.end() ? std::nullopt : std::optional(found->second);
  }
  void Keep(const std::string& place, const Fingerprint& print) {
    const std::lock_guard<std::mutex> guard(mutex_);
    prints_[place] = print;
  }

 private:
  std::mutex mutex_;
  std::map<std::string, Fingerprint> prints_;  ///< by the path on the disk
};

LastFound& TheLastFound() {
  static LastFound found;
  return found;
}

}  // namespace

bool Fingerprint::SameAs(const Fingerprint& other) const {
  if (!error.empty() || !other.error.empty() || files != other.files || bytes != other.bytes) return false;
  return stamp == other.stamp || (!sha256.empty() && sha256 == other.sha256);
}

Fingerprint FingerprintOf(const std::string& path, const Fingerprint* earlier) {
  Fingerprint print;
  print.path = path;
  try {
    const Found found = Find(path);
    print.files = found.files.size();
    print.bytes = found.bytes;
    print.links = found.links;
    if (found.num_faults > 0) {
      print.error = FaultText(found);
    } else if (!found.files.empty()) {
      const std::string place = PathOnDisk(path);
      const std::optional<Fingerprint> last = earlier ? std::nullopt : TheLastFound().Of(place);
      AddDigests(found, last ? &*last : earlier, &print);
      TheLastFound().Keep(place, print);
    }
  } catch (const std::exception& e) {
    print.error = e.what();
  }
  return print;
}

nlohmann::ordered_json FingerprintJson(const std::string& path) {
  const Fingerprint print = FingerprintOf(path);
  nlohmann::ordered_json item = {{"path", print.path}, {"files", print.files}, {"bytes", print.bytes}};
  if (!print.error.empty()) item["error"] = print.error;
  if (!print.sha256.empty()) item[IsFile(path) ? "sha256" : "sha256_of_list"] = print.sha256;
  return item;
}

}  // namespace mvstudio::stages
