#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/session/session.h"
#include "stages/session/options.h"

namespace mvstudio::stages {

struct SessionInitReport {
  SessionInitOptions options;
  dataset::Session session;  ///< as it was written
  dataset::ScannedSession scanned;
  std::vector<std::string> unnamed;  ///< cameras with footage that options.cameras does not name
  size_t expected = 0;               ///< cameras that options.cameras counts, where the footage's names took their places
  std::string link;                  ///< raw/ where it is a link to the footage; else empty

  std::string File() const { return (std::filesystem::path(options.folder) / "mvstudio.toml").string(); }
};

/// Makes the session's folders and its mvstudio.toml, with a link to footage that lies elsewhere. When a step fails, nothing
/// of it stays. Throws UsageError, IoError and FormatError.
SessionInitReport RunSessionInit(const SessionInitOptions& options);

struct SessionShowReport {
  SessionShowOptions options;
  dataset::Session session;
  dataset::SessionReport footage;
};

/// Throws IoError and FormatError; what is wrong with the footage is no error (SessionReport::findings).
SessionShowReport RunSessionShow(const SessionShowOptions& options, const RunContext& run = {});

struct SessionTrustReport {
  SessionTrustOptions options;
  std::vector<std::string> folders;  ///< outside the session, which it may read from now on
  std::string file;                  ///< that keeps this
};

/// Throws UsageError, IoError and FormatError.
SessionTrustReport RunSessionTrust(const SessionTrustOptions& options);

struct SessionTimelineReport {
  std::string take, file;                 ///< written
  std::vector<std::string> inputs;        ///< the footage
  std::vector<std::string> unknown_keys;  ///< Session::warnings
  std::vector<std::string> unfilmed;      ///< cameras of the session without footage in this take
  dataset::TakeTimeline made;
};

/// Writes the take's timeline. Throws UsageError, IoError and FormatError.
SessionTimelineReport RunSessionTimeline(const SessionTimelineOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
