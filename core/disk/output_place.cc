#include <pwd.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/disk/parents.h"
#include "core/disk/place.h"
#include "core/error.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

/// With the last link followed as well, where it leads somewhere.
fs::path Real(const std::string& path) {
  std::error_code error;
  const fs::path normal = internal::Normal(path), real = fs::canonical(normal, error);
  return error ? normal : real;
}

/// By name, or as the system knows them: a folder may be mounted in two places, or its name be known in capitals too.
bool IsSame(const fs::path& a, const fs::path& b) {
  std::error_code error;
  return a == b || fs::equivalent(a, b, error);
}

bool IsWithin(fs::path inner, const fs::path& outer) {
  while (!IsSame(inner, outer)) {
    if (inner == inner.parent_path()) return false;
    inner = inner.parent_path();
  }
  return true;
}

std::string HomeFolder() {
  const char* home = std::getenv("HOME");
  if (home && *home) return home;
  const passwd* user = getpwuid(getuid());
  return user && user->pw_dir ? user->pw_dir : "";
}

void RequireApart(const std::string& out, const fs::path& real, const std::string& folder, const std::string& what,
                  bool whole) {
  std::error_code error;
  if (folder.empty() || !fs::exists(folder, error)) return;
  const fs::path other = Real(folder);
  if (IsSame(real, other)) throw UsageError(out + ": is " + what + "; name a folder of its own with option 'out'");
  if (whole && IsWithin(other, real))
    throw UsageError(out + ": contains " + what + "; name a folder of its own with option 'out'");
}

bool Lists(const Manifest& manifest, const std::string& relative) {
  const auto inside = manifest.files.lower_bound(relative + "/");
  return manifest.files.count(relative) > 0 ||
         (inside != manifest.files.end() && inside->first.compare(0, relative.size() + 1, relative + "/") == 0);
}

/// A file or folder that mvstudio itself wrote below the output, as its manifests say.
bool WrittenThere(const fs::path& input, const fs::path& out) {
  for (fs::path folder = input.parent_path(); IsWithin(folder, out); folder = folder.parent_path()) {
    try {
      const auto manifest = ReadManifest(folder.string());
      if (manifest && Lists(*manifest, input.lexically_relative(folder).string())) return true;
    } catch (const Error&) {
      return false;
    }
    if (folder == folder.parent_path()) return false;
  }
  return false;
}

}  // namespace

void RequireSafeOutput(const std::string& out, const std::vector<std::string>& inputs, bool replaced_as_a_whole) {
  if (out.empty()) throw UsageError("the name of an output is empty; give a path");
  RequireFreeName(out);
  const fs::path real = Real(out);
  RequireApart(out, real, "/", "the root of the file system", false);
  RequireApart(out, real, HomeFolder(), "the home folder", replaced_as_a_whole);
  RequireApart(out, real, ".", "the current folder", replaced_as_a_whole);
  for (const std::string& input : inputs) {
    std::error_code error;
    if (input.empty() || !fs::exists(input, error)) continue;
    const fs::path other = Real(input);
    if (IsSame(real, other)) throw UsageError(out + ": is the input " + input + " itself; choose another option 'out'");
    const bool within = IsWithin(real, other) && fs::is_directory(other, error);
    if (within) throw UsageError(out + ": lies in the input " + input + "; choose another option 'out'");
    if (IsWithin(other, real) && (replaced_as_a_whole || !WrittenThere(other, real)))
      throw UsageError(out + ": contains the input " + input + "; choose another option 'out'");
  }
}

}  // namespace mvstudio
