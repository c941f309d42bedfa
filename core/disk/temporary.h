#pragma once

#include <mutex>
#include <string>

namespace mvstudio {

/// For an early exit of the process: waits for a commit in progress, prevents further ones, and removes the temporary
/// files, work folders and lock files of this process. Other threads stop at their next publishing step.
void AbandonTemporaries();

/// `text` with the names of temporary files and folders of this process replaced by their final names, for messages.
std::string FinalNames(std::string text);

namespace internal {

/// 32 hexadecimal digits of random bits from the system.
std::string RandomTag();

/// Name of a new temporary beside `final_path`: random, with the same extension.
std::string TemporaryBeside(const std::string& final_path);

/// Temporary name of the old folder during a swap in two steps; SweepLeftovers restores it.
std::string OldFolderBeside(const std::string& path);

/// Creates and registers an empty temporary file; it belongs to this process as long as the returned descriptor is open.
/// Throws IoError.
int CreateTemporary(const std::string& temporary, const std::string& final_path);
/// Same for a work folder, which starts with a manifest that marks it as one.
int CreateWorkFolder(const std::string& temporary, const std::string& final_path);

/// Removes a work folder. The marker is removed last, so that the rest is swept if the process is killed meanwhile.
void RemoveWorkFolder(const std::string& folder);

enum class TemporaryKind { kFile, kFolder, kLock };

/// Everything that must not outlive this process. A registered folder is a work folder: files below it belong to this
/// process alone.
void RegisterTemporary(const std::string& path, const std::string& final_path, TemporaryKind kind);
void UnregisterTemporary(const std::string& path);
/// Whether the path is inside a work folder of this process.
bool InWorkFolder(const std::string& path);

/// Held from the first to the last rename of a commit.
std::recursive_mutex& PublishMutex();

/// Removes what dead processes left in a folder: temporary files and folders, lock files; restores the old folder where a
/// swap was interrupted. Examines each folder once per process unless `again`.
void SweepLeftovers(const std::string& folder, bool again = false);
/// Whether the path is a temporary or a lock file of this process.
bool IsTemporaryHere(const std::string& path);
/// Whether a name is one of a temporary file or folder, or of a lock file.
bool IsTemporaryName(const std::string& name);
bool IsLockName(const std::string& name);

}  // namespace internal
}  // namespace mvstudio
