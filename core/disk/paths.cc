#include "core/disk/paths.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/utf8.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

/// The end of the set of characters that begins at `at`, behind its bracket; `at` when none does.
size_t SetEnd(std::string_view text, size_t at) {
  const size_t first = at + 1 < text.size() && text[at + 1] == '!' ? at + 2 : at + 1;
  const size_t close = text.find(']', first + 1);  // a bracket that comes first belongs to the set
  return text[at] != '[' || close == std::string_view::npos ? at : close + 1;
}

/// Where the first group of alternatives, `{a,b}`, begins and ends (behind its brace); equal when there is none.
std::pair<size_t, size_t> Alternatives(std::string_view text) {
  for (size_t open = text.find('{'); open != std::string_view::npos; open = text.find('{', open + 1)) {
    const size_t close = text.find_first_of("{}", open + 1);
    const bool whole = close != std::string_view::npos && text[close] == '}';
    if (whole && text.substr(open, close - open).find(',') != std::string_view::npos) return {open, close + 1};
  }
  return {0, 0};
}

bool HasSets(std::string_view text) {
  for (size_t at = text.find('['); at != std::string_view::npos; at = text.find('[', at + 1)) {
    if (SetEnd(text, at) > at) return true;
  }
  return Alternatives(text).second > 0;
}

bool HasWildcards(std::string_view text) { return text.find_first_of("*?") != std::string_view::npos || HasSets(text); }

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

using Spans = std::vector<std::pair<size_t, size_t>>;

/// Whether a character is in the set `[...]`.
bool InSet(std::string_view character, std::string_view set) {
  set = set.substr(1, set.size() - 2);
  const bool negated = set[0] == '!' && set.size() > 1;
  bool found = false;
  for (size_t at = negated ? 1 : 0; at < set.size();) {
    const std::string_view low = set.substr(at, CharacterLength(set, at));
    at += low.size();
    std::string_view high = low;
    if (at + 1 < set.size() && set[at] == '-') {
      high = set.substr(at + 1, CharacterLength(set, at + 1));
      at += 1 + high.size();
    }
    found |= low.size() == character.size() && low <= character && character <= high;
  }
  return found != negated;
}

/// The text in `name` of each wildcard of `pattern`, or nothing. Goes back to the last `*` only, so the time is at most that of
/// the product of the lengths. Without `sets`, brackets are ordinary characters.
std::optional<Spans> Match(std::string_view name, std::string_view pattern, bool sets) {
  size_t n = 0, p = 0, star = std::string_view::npos, spans_before = 0;
  Spans spans;
  while (n < name.size() || p < pattern.size()) {
    const size_t set_end = sets && p < pattern.size() ? SetEnd(pattern, p) : p;
    const size_t length = n < name.size() ? CharacterLength(name, n) : 0;
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++, spans_before = spans.size();
      spans.push_back({n, n});
    } else if (length > 0 && p < pattern.size() && pattern[p] == '?') {
      spans.push_back({n, n + length}), ++p, n += length;
    } else if (length > 0 && set_end > p && InSet(name.substr(n, length), pattern.substr(p, set_end - p))) {
      spans.push_back({n, n + length}), p = set_end, n += length;
    } else if (length > 0 && set_end == p && p < pattern.size() && pattern[p] == name[n]) {
      ++p, ++n;
    } else if (star != std::string_view::npos && spans[spans_before].second < name.size()) {
      spans.resize(spans_before + 1);
      p = star + 1, n = ++spans.back().second;
    } else {
      return std::nullopt;
    }
  }
  return spans;
}

/// The same with the first alternatives of `{a,b}` that match; their text counts as a wildcard's.
std::optional<Spans> MatchAny(std::string_view name, const std::string& pattern, int depth = 0) {
  constexpr int kMostGroups = 6;
  const auto [open, close] = Alternatives(pattern);
  if (close == 0 || depth == kMostGroups) return Match(name, pattern, true);
  for (size_t at = open + 1; at < close;) {
    const size_t end = pattern.find_first_of(",}", at);
    const std::string text = pattern.substr(at, end - at);
    if (auto spans = MatchAny(name, pattern.substr(0, open) + text + pattern.substr(close), depth + 1)) {
      const size_t place = name.find(text, std::min(open, name.size()));  // exact when no star stands before
      if (!text.empty() && place != std::string_view::npos) spans->push_back({place, place + text.size()});
      std::sort(spans->begin(), spans->end());
      return spans;
    }
    at = end + 1;
  }
  return std::nullopt;
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
  const std::vector<std::string> names = Names(folder, part[0] == '.');
  std::vector<fs::path> found;
  for (const std::string& name : names) {
    if (Match(name, part, false)) found.push_back(folder / name);
  }
  if (!found.empty() || !HasSets(part)) return found;
  for (const std::string& name : names) {
    if (MatchAny(name, part)) found.push_back(folder / name);
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

std::vector<std::pair<size_t, size_t>> WildSpans(const std::string& path, const std::string& pattern) {
  std::vector<std::string> parts;
  for (const fs::path& part : fs::path(pattern)) {
    if (!part.empty()) parts.push_back(part.string());
  }
  Spans all;
  size_t end = path.size();
  for (auto part = parts.rbegin(); part != parts.rend() && end != std::string::npos; ++part) {
    const size_t slash = end == 0 ? std::string::npos : path.rfind('/', end - 1);
    const size_t begin = slash == std::string::npos ? 0 : slash + 1;
    const std::string name = path.substr(begin, end - begin);
    end = slash;
    if (name == *part) continue;
    auto spans = Match(name, *part, false);
    if (!spans) spans = MatchAny(name, *part);
    for (const auto& [first, last] : spans.value_or(Spans())) all.push_back({begin + first, begin + last});
  }
  std::sort(all.begin(), all.end());
  return all;
}

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
