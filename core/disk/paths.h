#pragma once

#include <string>
#include <vector>

/// Finding files: by listing folders, never by turning a folder's name into a pattern.
namespace mvstudio {

/// Files of a folder, sorted; hidden ones are left out, links are followed. Empty when there is no such folder. Throws IoError
/// when it cannot be listed.
std::vector<std::string> FilesIn(const std::string& folder);

/// Those whose name begins and ends so, hidden ones only when `prefix` begins with a dot.
std::vector<std::string> FilesNamed(const std::string& folder, const std::string& prefix, const std::string& suffix);

/// Names of what a folder holds, hidden ones left out, sorted; none when there is no such folder. Throws IoError when the folder
/// cannot be listed: what cannot be seen must not pass for what is not there.
std::vector<std::string> NamesIn(const std::string& folder);

/// What a user names: a file; a folder, which stands for its files; or a pattern in which `*` is any text and `?` any character
/// of one part of the path. What exists under its literal name is taken by it, the whole path as well as each part; `[` and `]`
/// are ordinary characters. Sorted; folders are left out. Empty when there is nothing.
std::vector<std::string> FilesMatching(const std::string& pattern);

/// True when the text holds `*` or `?` and nothing exists under that very name.
bool IsPattern(const std::string& path);

/// Throws IoError unless `path` is an ordinary file, or a link to one: opening a named pipe waits for ever, a device never
/// ends.
void RequireRegularFile(const std::string& path);

}  // namespace mvstudio
