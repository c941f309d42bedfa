#pragma once

#include <map>
#include <set>
#include <string>

namespace mvstudio {

/// What this process reads by ReadFile and what it publishes while the object lives: absolute paths, a folder that appears as a
/// whole by its own, and so is one of which very many files are read. Traces nest; the innermost one sees.
class DiskTrace {
 public:
  DiskTrace();
  ~DiskTrace();
  DiskTrace(const DiskTrace&) = delete;
  DiskTrace& operator=(const DiskTrace&) = delete;

  std::set<std::string> read() const;
  std::set<std::string> published() const;

 private:
  DiskTrace* outer_;
  std::map<std::string, std::set<std::string>> read_;  ///< names by folder, as they were given; none: very many
  std::set<std::string> published_;

  friend void TraceRead(const std::string& path);
  friend void TracePublished(const std::string& path);
};

/// While it lives, this thread leaves no trace: for caches, without which a run gives the same results.
class UntracedScope {
 public:
  UntracedScope();
  ~UntracedScope();
  UntracedScope(const UntracedScope&) = delete;
  UntracedScope& operator=(const UntracedScope&) = delete;
};

void TraceRead(const std::string& path);
void TracePublished(const std::string& path);

}  // namespace mvstudio
