#include "core/disk/trace.h"

#include <mutex>

#include "core/disk/parents.h"

namespace mvstudio {
namespace {

/// Of one folder. A take has hundreds of thousands of files, and their paths would grow with it.
constexpr size_t kMostNames = 200;

std::mutex trace_mutex;
DiskTrace* innermost = nullptr;
thread_local int untraced = 0;

}  // namespace

DiskTrace::DiskTrace() {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  outer_ = innermost;
  innermost = this;
}

DiskTrace::~DiskTrace() {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  innermost = outer_;
}

std::set<std::string> DiskTrace::read() const {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  std::set<std::string> paths;
  for (const auto& [folder, names] : read_) {
    if (names.empty()) paths.insert(internal::Normal(folder.empty() ? "." : folder));
    for (const std::string& name : names) paths.insert(internal::Normal(folder + name));
  }
  return paths;
}

std::set<std::string> DiskTrace::published() const {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  return published_;
}

UntracedScope::UntracedScope() { ++untraced; }
UntracedScope::~UntracedScope() { --untraced; }

void TraceRead(const std::string& path) {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  if (!innermost || untraced > 0) return;
  const size_t name = path.rfind('/') + 1;  // 0: none
  const auto [folder, is_new] = innermost->read_.try_emplace(path.substr(0, name));
  std::set<std::string>& names = folder->second;
  if (!is_new && names.empty()) return;
  names.insert(path.substr(name));
  if (names.size() > kMostNames) names.clear();
}

void TracePublished(const std::string& path) {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  if (innermost && untraced == 0) innermost->published_.insert(internal::Normal(path));
}

}  // namespace mvstudio
