#include "core/disk/replace.h"

#include <sys/statvfs.h>
#include <unistd.h>

#include <filesystem>
#include <mutex>
#include <set>

#include "core/disk/manifest.h"
#include "core/disk/parents.h"
#include "core/disk/system_calls.h"
#include "core/disk/temporary.h"
#include "core/error.h"

namespace mvstudio {
namespace {

enum class Rule { kNone, kReplace, kKeep };

struct Results {
  std::mutex mutex;
  Rule rule = Rule::kNone;
  std::set<std::string> written;
};

Results& Shared() {
  static Results results;
  return results;
}

bool IsThere(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::exists(std::filesystem::symlink_status(path, ignored));
}

}  // namespace

ReplaceScope::ReplaceScope(bool allowed) {
  Results& results = Shared();
  const std::lock_guard<std::mutex> lock(results.mutex);
  outermost_ = results.rule == Rule::kNone;
  if (!outermost_) return;
  results.rule = allowed ? Rule::kReplace : Rule::kKeep;
  results.written.clear();
}

ReplaceScope::~ReplaceScope() {
  if (!outermost_) return;
  const std::lock_guard<std::mutex> lock(Shared().mutex);
  Shared().rule = Rule::kNone;
}

bool MayReplace() {
  const std::lock_guard<std::mutex> lock(Shared().mutex);
  return Shared().rule != Rule::kKeep;
}

void RequireNoResult(const std::string& path) {
  if (MayReplace() || !IsThere(path)) return;
  {
    const std::lock_guard<std::mutex> lock(Shared().mutex);
    if (Shared().written.count(internal::Normal(path)) > 0) return;
  }
  const std::string writer = WriterOf(path);
  throw ResultExistsError(path, path + ": is a result of an earlier run" +
                                    (writer.empty() ? "" : " of `mvstudio " + writer + "`") +
                                    "; choose another option 'out' or pass option 'overwrite'");
}

void RequireRoomIn(const std::string& folder) {
  constexpr double kLeastBytes = 64 * 1024;  // of a result and its records
  std::string there = internal::Normal(folder);
  while (!internal::Exists(there) && there != "/") there = internal::ParentOf(there);
  std::error_code ignored;
  if (!std::filesystem::is_directory(there, ignored)) return;  // what is wrong with it its writer says better
  const std::string trial = internal::TemporaryBeside(there + "/trial");
  const int fd = internal::CreateWorkFolder(trial, folder);
  internal::RemoveWorkFolder(trial);
  internal::UnregisterTemporary(trial);
  close(fd);
  struct statvfs disk {};
  if (statvfs(there.c_str(), &disk) != 0 || disk.f_blocks == 0) return;
  if (static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize) < kLeastBytes)
    throw ResourceError(folder + ": the disk is full: make room, or choose another option 'out'");
}

namespace internal {

void RecordResults(const std::vector<std::string>& paths) {
  const std::lock_guard<std::mutex> lock(Shared().mutex);
  if (Shared().rule != Rule::kKeep) return;
  for (const std::string& path : paths) Shared().written.insert(Normal(path));
}

}  // namespace internal
}  // namespace mvstudio
