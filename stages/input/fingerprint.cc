#include "stages/input/fingerprint.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/disk/manifest.h"
#include "core/disk/paths.h"
#include "core/hash/sha256.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

constexpr uintmax_t kMaxHashedBytes = 2ull << 30;

struct Found {
  std::vector<std::string> files;
  uintmax_t bytes = 0;
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

/// Records about results, not results: a command that reads a folder and leaves its record there has not changed its input.
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
    } else if (!fs::is_directory(name, error) && !IsRecord(at->path().filename().string())) {
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

std::string DigestOfList(const std::string& path, const std::vector<std::string>& files) {
  Sha256 all;
  for (const std::string& file : files) {
    const std::string line = KnownDigest(file).sha256 + " " + file.substr(std::min(path.size(), file.size())) + "\n";
    all.Update(line.data(), line.size());
  }
  return all.HexDigest();
}

void AddDigest(const std::string& path, const Found& found, Json* item) {
  if (found.files.size() == 1) {
    (*item)["sha256"] = KnownDigest(found.files.front()).sha256;
  } else {
    (*item)["sha256_of_list"] = DigestOfList(path, found.files);
  }
}

std::string FaultText(const Found& found) {
  const std::string others = std::to_string(found.num_faults - 1);
  return found.first_fault + (found.num_faults > 1 ? " (and " + others + " more)" : "");
}

}  // namespace

Json Fingerprint(const std::string& path) {
  Json item = {{"path", path}};
  try {
    const Found found = Find(path);
    item["files"] = found.files.size();
    item["bytes"] = found.bytes;
    if (found.num_faults > 0) {
      item["error"] = FaultText(found);
    } else if (!found.files.empty() && found.bytes <= kMaxHashedBytes) {
      AddDigest(path, found, &item);
    }
  } catch (const std::exception& e) {
    item["error"] = e.what();
  }
  return item;
}

}  // namespace mvstudio::stages
