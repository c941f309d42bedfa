#include "core/disk/trace.h"

#include <mutex>

#include "core/disk/parents.h"

namespace mvstudio {
namespace {

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
  return read_;
}

std::set<std::string> DiskTrace::published() const {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  return published_;
}

UntracedScope::UntracedScope() { ++untraced; }
UntracedScope::~UntracedScope() { --untraced; }

void TraceRead(const std::string& path) {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  if (innermost && untraced == 0) innermost->read_.insert(internal::Normal(path));
}

void TracePublished(const std::string& path) {
  const std::lock_guard<std::mutex> guard(trace_mutex);
  if (innermost && untraced == 0) innermost->published_.insert(internal::Normal(path));
}

}  // namespace mvstudio
