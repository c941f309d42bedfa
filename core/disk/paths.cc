#include "core/disk/paths.h"

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "core/error.h"
#include "core/utf8.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

bool HasWildcards(std::string_view text) { return text.find_first_of("*?") != std::string_view::npos; }

bool StartsWith(std::string_view text, std::string_view start) { return text.substr(0, start.size()) == start; }

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

/// Also a link that leads nowhere.
bool Exists(const fs::path& path) {
  std::error_code error;
  const bool there = fs::exists(fs::symlink_status(path, error));
  if (error && error != std::errc::no_such_file_or_directory && error != std::errc::not_a_directory &&
      error != std::errc::filename_too_long)
    throw IoError(path.string(), "cannot be looked at: " + error.message());
  return there;
}

bool IsFolder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

/// Bytes of the character at `at`; of text that is not UTF-8, one.
size_t CharacterLength(std::string_view text, size_t at) { return std::max<size_t>(Utf8Length(text, at), 1); }

/// Goes back to the last `*` only, so the time is at most that of the product of the lengths.
bool Matches(std::string_view name, std::string_view pattern) {
  size_t n = 0, p = 0, star = std::string_view::npos, resume = 0;
  while (n < name.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++, resume = n;
    } else if (p < pattern.size() && pattern[p] == '?') {
      ++p, n += CharacterLength(name, n);
    } else if (p < pattern.size() && pattern[p] == name[n]) {
      ++p, ++n;
    } else if (star != std::string_view::npos) {
      p = star + 1, n = ++resume;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

/// Names in a folder in the order of the disk, hidden ones only when they are asked for.
std::vector<std::string> Names(const fs::path& folder, bool hidden) {
  std::vector<std::string> names;
  std::error_code error;
  const fs::path listed = folder.empty() ? fs::path(".") : folder;
  for (fs::directory_iterator at(listed, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (hidden || name[0] != '.') names.push_back(name);
  }
  if (error) throw IoError(listed.string(), "the folder cannot be listed: " + error.message());
  return names;
}

/// What `part` stands for in `folder`.
std::vector<fs::path> Step(const fs::path& folder, const std::string& part) {
  if (!HasWildcards(part) || Exists(folder / part)) return {folder / part};
  std::vector<fs::path> found;
  for (const std::string& name : Names(folder, part[0] == '.')) {
    if (Matches(name, part)) found.push_back(folder / name);
  }
  return found;
}

template <class Wanted>
std::vector<std::string> RegularFiles(const std::string& folder, bool hidden, const Wanted& wanted) {
  std::vector<std::string> files;
  if (!IsFolder(folder)) return files;
  for (const std::string& name : Names(folder, hidden)) {
    std::error_code ignored;
    const fs::path path = fs::path(folder) / name;
    if (wanted(name) && fs::is_regular_file(path, ignored)) files.push_back(path.string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

const char* KindName(fs::file_type type) {
  switch (type) {
    case fs::file_type::directory:
      return "a folder";
    case fs::file_type::fifo:
      return "a named pipe";
    case fs::file_type::character:
    case fs::file_type::block:
      return "a device";
    case fs::file_type::socket:
      return "a socket";
    default:
      return "no ordinary file";
  }
}

}  // namespace

std::vector<std::string> NamesIn(const std::string& folder) {
  if (!IsFolder(folder)) return {};
  std::vector<std::string> names = Names(folder, false);
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<std::string> FilesIn(const std::string& folder) {
  return RegularFiles(folder, false, [](const std::string&) { return true; });
}

std::vector<std::string> FilesNamed(const std::string& folder, const std::string& prefix, const std::string& suffix) {
  return RegularFiles(folder, StartsWith(prefix, "."), [&](const std::string& name) {
    return name.size() >= prefix.size() + suffix.size() && StartsWith(name, prefix) && EndsWith(name, suffix);
  });
}

std::vector<std::string> FilesMatching(const std::string& pattern) {
  if (IsFolder(pattern)) return FilesIn(pattern);
  if (pattern.empty() || pattern.find('\0') != std::string::npos) return {};
  std::vector<fs::path> found = {fs::path()};
  for (const fs::path& part : fs::path(pattern)) {
    if (part.empty()) continue;
    std::vector<fs::path> next;
    for (const fs::path& folder : found) {
      if (!folder.empty() && !IsFolder(folder)) continue;
      for (fs::path& path : Step(folder, part.string())) next.push_back(std::move(path));
    }
    found = std::move(next);
  }
  std::vector<std::string> files;
  for (const fs::path& path : found) {
    if (Exists(path) && !IsFolder(path)) files.push_back(path.string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

bool IsPattern(const std::string& path) { return HasWildcards(path) && !Exists(path); }

void RequireFolder(const std::string& path, const std::string& hint) {
  if (IsFolder(path)) return;
  throw IoError(path, (Exists(path) ? "is a file, a folder was expected" : "no such folder") + hint);
}

void RequireRegularFile(const std::string& path) {
  std::error_code error;
  const fs::file_type type = fs::status(path, error).type();
  if (type == fs::file_type::none) throw IoError(path, "cannot open: " + error.message());
  if (type == fs::file_type::not_found) throw IoError(path, "no such file");
  if (type != fs::file_type::regular)
    throw IoError(path, std::string("is ") + KindName(type) + ", a regular file was expected");
}

}  // namespace mvstudio
