#include "dataset/session/trust.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/error.h"
#include "core/join.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

/// Why the file of trust does not count; empty when it does, or is not there.
std::string WhyNotOurs(const std::string& path) {
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) return "";
  if (!S_ISREG(info.st_mode)) return "is no ordinary file";
  if (info.st_uid != geteuid()) return "belongs to another user";
  return (info.st_mode & (S_IWGRP | S_IWOTH)) != 0 ? "is open for others to write" : "";
}

std::string AbsoluteVariable(const char* name) {
  const char* value = std::getenv(name);
  return value && *value == '/' ? value : "";
}

std::vector<std::vector<std::string>> TrustLines(const std::string& path) {
  std::vector<std::vector<std::string>> lines;
  if (!fs::exists(path)) return lines;
  std::istringstream text(ReadFile(path));
  for (std::string line; std::getline(text, line);) {
    std::vector<std::string>& names = lines.emplace_back();
    std::istringstream words(line);
    for (std::string name; std::getline(words, name, '\t');) names.push_back(name);
    if (names.empty()) lines.pop_back();
  }
  return lines;
}

}  // namespace

std::string TrustFile() {
  const std::string state = AbsoluteVariable("XDG_STATE_HOME"), home = AbsoluteVariable("HOME");
  if (state.empty() && home.empty()) return "";
  return (state.empty() ? home + "/.local/state" : state) + "/mvstudio/trusted";
}

std::vector<std::string> TrustedFolders(const std::string& session_folder, std::vector<std::string>* warnings) {
  const std::string path = TrustFile();
  std::error_code error;
  if (path.empty() || !fs::exists(fs::symlink_status(path, error))) return {};
  const std::string why = WhyNotOurs(path);
  if (!why.empty()) {
    warnings->push_back(path + " " + why + ", so that no session is trusted by it");
    return {};
  }
  const std::string session = fs::canonical(session_folder).string();
  for (const std::vector<std::string>& line : TrustLines(path)) {
    if (line[0] == session) return {line.begin() + 1, line.end()};
  }
  return {};
}

void TrustSession(const std::string& session_folder, const std::vector<std::string>& folders) {
  const std::string path = TrustFile();
  if (path.empty()) throw UsageError("no place to note trusted sessions: set HOME or XDG_STATE_HOME");
  const std::string why = WhyNotOurs(path);
  if (!why.empty()) throw UsageError(path + " " + why + "; move it away, and sessions can be trusted anew");
  MakeFolder(fs::path(path).parent_path().string());
  const OutputLock lock(path);
  std::vector<std::string> mine = {fs::canonical(session_folder).string()};
  mine.insert(mine.end(), folders.begin(), folders.end());
  for (const std::string& name : mine) {
    if (name.find_first_of("\t\n") != std::string::npos)
      throw UsageError(name + ": a folder with a tab or a line break in its name cannot be trusted; rename it");
  }
  std::string text;
  for (const std::vector<std::string>& line : TrustLines(path))
    if (line[0] != mine[0]) text += Join(line, "\t") + "\n";
  if (!folders.empty()) text += Join(mine, "\t") + "\n";
  WriteFileAtomic(path, [&](const std::string& temporary) {
    WriteFile(temporary, text);
    MakePrivate(temporary);
  });
}

}  // namespace mvstudio::dataset
