#pragma once

#include <string>
#include <utility>
#include <vector>

/// Finds files by listing folders; a folder's name is never used as a pattern.
namespace mvstudio {

/// Files of a folder, sorted, without hidden ones; links are followed. Empty when the folder does not exist. Throws
/// IoError when it cannot be listed.
std::vector<std::string> FilesIn(const std::string& folder);

/// Files whose name has this prefix and suffix; hidden ones only when `prefix` begins with a dot.
std::vector<std::string> FilesNamed(const std::string& folder, const std::string& prefix, const std::string& suffix);

/// Names in a folder, sorted, without hidden ones; empty when the folder does not exist. Throws IoError when the folder
/// cannot be listed, so that an unreadable folder does not count as empty.
std::vector<std::string> NamesIn(const std::string& folder);

/// Files that a user's argument names: a file; a folder, which stands for its files; or a pattern. In one part of its path, `*`
/// is any text, `?` any character, `[0-9]` one of some characters (`[!0-9]` none of them), `{a,b}` one of some texts. An
/// existing literal name takes precedence, for the whole path as well as each part, and so does a reading of the part in which
/// brackets and braces stand for themselves. Sorted, without folders. Empty when nothing matches.
std::vector<std::string> FilesMatching(const std::string& pattern);

/// True when the text contains wildcards as above and nothing exists under this literal name.
bool IsPattern(const std::string& path);

/// Bytes [first, second) of a path that a wildcard of the pattern stands for, in order; `path` is one of
/// FilesMatching(pattern).
std::vector<std::pair<size_t, size_t>> WildSpans(const std::string& path, const std::string& pattern);

/// Throws IoError unless `path` is a folder, or a link to one. `hint`: what to do, "; give …".
void RequireFolder(const std::string& path, const std::string& hint = {});

/// Throws IoError unless `path` is an ordinary file, or a link to one: opening a named pipe may wait forever, and a device
/// never ends.
void RequireRegularFile(const std::string& path);

}  // namespace mvstudio
