#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace mvstudio::stages {

/// What a file, or all files of a folder or of a pattern, are at one moment. Records of mvstudio about results are no results:
/// `.mvstudio…`, `provenance.jsonl` and `*.result.json` are not counted.
struct Fingerprint {
  std::string path;
  uint64_t files = 0, bytes = 0;
  std::string stamp;      ///< SHA-256 of names, sizes and times of change: equal where nothing was touched
  std::string sha256;     ///< of the content of one file, of the list of digests and names of several; empty beyond 2 GiB
  int64_t newest_ns = 0;  ///< ns since 1970; the latest time of change of a file
  bool links = false;     ///< the folder holds links to folders, whose files are not counted
  std::string error;      ///< what cannot be read: no right to, a loop of links, gone meanwhile, a pipe; then no digests

  /// Equal contents; where they are too large to be read, untouched ones.
  bool SameAs(const Fingerprint& other) const;
};

/// Never throws. The content is not read where the stamp is that of `earlier`.
Fingerprint FingerprintOf(const std::string& path, const Fingerprint* earlier = nullptr);

/// Number, size and digest, or the error, for provenance. Never throws.
nlohmann::ordered_json FingerprintJson(const std::string& path);

}  // namespace mvstudio::stages
