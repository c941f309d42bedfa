#pragma once

#include <mutex>
#include <string>

namespace mvstudio {

/// For the moment before a process ends early: waits for a commit that is under way, lets no other begin, and removes the
/// temporary files, work folders and lock files of this process. Other threads stop at their next step that publishes.
void AbandonTemporaries();

/// `text` with the names of temporary files and folders of this process replaced by those that they stand for, for messages.
std::string FinalNames(std::string text);

namespace internal {

/// 32 hexadecimal digits of random bits from the system.
std::string RandomTag();

/// Name of a new temporary beside `final_path`: random, with its extension.
std::string TemporaryBeside(const std::string& final_path);

/// Name under which a folder waits for the end of a swap in two steps; a sweep puts it back.
std::string OldFolderBeside(const std::string& path);

/// Makes and registers an empty temporary file; it is ours as long as the descriptor that is returned stays open. Throws
/// IoError.
int CreateTemporary(const std::string& temporary, const std::string& final_path);
/// The same for a work folder, which begins with a manifest that says so.
int CreateWorkFolder(const std::string& temporary, const std::string& final_path);

/// Removes a work folder; what says that it is one goes last, so that the rest is swept should the process be killed meanwhile.
void RemoveWorkFolder(const std::string& folder);

enum class TemporaryKind { kFile, kFolder, kLock };

/// Everything that must not outlive this process. A registered folder is a work folder: files below it are nobody's but ours.
void RegisterTemporary(const std::string& path, const std::string& final_path, TemporaryKind kind);
void UnregisterTemporary(const std::string& path);
/// Whether the path lies in a work folder of this process.
bool InWorkFolder(const std::string& path);

/// Held from the first to the last rename of a commit.
std::recursive_mutex& PublishMutex();

/// Removes what processes that are no more left in a folder: temporary files and folders, lock files; puts back the old folder
/// where a swap was cut. Looks at each folder once a process unless `again`.
void SweepLeftovers(const std::string& folder, bool again = false);
/// Whether the path is a temporary or a lock file of this process.
bool IsTemporaryHere(const std::string& path);
/// Whether a name is one of a temporary file or folder, or of a lock file.
bool IsTemporaryName(const std::string& name);
bool IsLockName(const std::string& name);

}  // namespace internal
}  // namespace mvstudio
