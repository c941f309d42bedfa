#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mvstudio {

/// Lists the files of a folder that mvstudio wrote, with digests: only these may be replaced or removed, and only while
/// they are unchanged. Stored in the folder itself.
inline constexpr char kManifestName[] = ".mvstudio.json";

/// Digest of a file's bytes, or of the target of a symbolic link.
struct FileDigest {
  uint64_t size = 0;
  std::string sha256;  ///< hexadecimal; of the target's name for a symbolic link
  bool operator==(const FileDigest& other) const { return size == other.size && sha256 == other.sha256; }
};

struct ManifestEntry {
  FileDigest now;
  /// Of the file that `now` replaces: the manifest is written first, so after a crash either may exist.
  std::optional<FileDigest> before = {};
  std::string by = {};  ///< the command that wrote it, if it differs from the manifest's
};

struct Manifest {
  bool whole = true;  ///< false: a work folder that is still being filled
  std::string command, version;
  std::map<std::string, ManifestEntry> files;  ///< by path relative to the folder; folders end in a slash and have no digest
};

/// Command and version of the writer, for manifests and lock files. Set once by the program.
void SetWriterName(const std::string& command, const std::string& version);
std::pair<std::string, std::string> WriterName();

std::string ManifestToJsonText(const Manifest& manifest);
/// Reads only what the function above writes. Throws FormatError.
Manifest ManifestFromJsonText(std::string_view text, const std::string& path);
/// The manifest of a folder; empty when it has none.
std::optional<Manifest> ReadManifest(const std::string& folder);

/// The command that wrote a file, according to the manifests; empty when unknown.
std::string WriterOf(const std::string& path);

/// Digest of a file or of a symbolic link.
FileDigest DigestOf(const std::string& path);
/// Same, but a file that this process has read or written, and that has not changed since, is not read again.
FileDigest KnownDigest(const std::string& path);

/// Everything at or below `path` that mvstudio did not write, or that was changed since, and so must not be touched.
/// Sorted.
std::vector<std::string> FilesInTheWay(const std::string& path);

/// Throws UsageError with the list of such files.
void RequireOurs(const std::vector<std::string>& paths);

/// Removes files and folders that mvstudio wrote; throws UsageError, before anything is removed, when it did not write
/// one.
void RemoveOurs(const std::vector<std::string>& paths);

}  // namespace mvstudio
