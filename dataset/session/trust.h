#pragma once

#include <string>
#include <vector>

/// Folders outside a session that its user lets it read without being asked again. They stand outside the session, which may
/// come from other people.
namespace mvstudio::dataset {

/// $XDG_STATE_HOME/mvstudio/trusted, else ~/.local/state/mvstudio/trusted; empty where neither variable is an absolute path. A
/// line for each session: its folder, then those that it may read, with tabs between them, links followed.
std::string TrustFile();

/// What the session may read. None for one that was moved or copied. A file that is a link, another user's, or open for others
/// to write counts for nothing, and a warning says so.
std::vector<std::string> TrustedFolders(const std::string& session_folder, std::vector<std::string>* warnings);

/// Replaces the session's line; no folders: it has none any more. Throws UsageError for a file that does not count, and for
/// names with a tab or a line break.
void TrustSession(const std::string& session_folder, const std::vector<std::string>& folders);

}  // namespace mvstudio::dataset
