#include "core/disk/place.h"

#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "core/disk/manifest.h"
#include "core/disk/parents.h"
#include "core/disk/system_calls.h"
#include "core/disk/temporary.h"
#include "core/error.h"

namespace mvstudio {
namespace fs = std::filesystem;
namespace {

constexpr char kProvenanceName[] = "provenance.jsonl";
constexpr char kResultEnd[] = ".result.json";
/// Of files that commands write.
constexpr const char* kFileEndings[] = {".bvh",  ".c3d", ".cameramodel", ".csv", ".glb",         ".gltf", ".h5",
                                        ".html", ".jpg", ".json",        ".md",  ".mp4",         ".npy",  ".npz",
                                        ".obj",  ".pdf", ".ply",         ".png", ".safetensors", ".smc",  ".svg",
                                        ".toml", ".trc", ".txt",         ".xml", ".yaml",        ".yml"};

std::vector<std::string> PartsOf(const std::string& path) {
  std::vector<std::string> parts;
  for (size_t begin = 0; begin < path.size();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    if (end > begin) parts.push_back(path.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

/// A path that is taken apart from left to right, as the system does it.
class Walk {
 public:
  explicit Walk(const std::string& path) : path_(path) {}

  void Step(const std::string& part, bool followed) {
    if (part == ".") return;
    if (part == "..") {
      if (missing_) throw IoError(path_, "there is no folder " + at_ + ", so `..` after it leads nowhere");
      at_.resize(at_.empty() ? 0 : at_.rfind('/'));
      return;
    }
    at_ += "/" + part;
    if (followed && !missing_) Follow();
  }
  std::string End() const { return at_.empty() ? "/" : at_; }

 private:
  void Follow() {
    struct stat info {};
    if (lstat(at_.c_str(), &info) != 0) {
      if (errno != ENOENT) internal::ThrowErrno(path_, "cannot look at " + at_, errno);
      missing_ = true;
      return;
    }
    if (S_ISDIR(info.st_mode)) return;
    char real[PATH_MAX];
    if (S_ISLNK(info.st_mode) && !realpath(at_.c_str(), real))
      throw IoError(path_, at_ + " is a symbolic link that leads nowhere: " + std::strerror(errno));
    if (S_ISLNK(info.st_mode) && stat(real, &info) == 0) at_ = real;
    if (!S_ISDIR(info.st_mode)) throw IoError(path_, at_ + " is a file, a folder was expected");
    if (at_ == "/") at_.clear();
  }

  const std::string& path_;
  std::string at_;        // without links so far; empty: the root
  bool missing_ = false;  // from here on nothing is there
};

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

bool BeginsWith(const std::string& text, const char* head) { return text.compare(0, std::strlen(head), head) == 0; }

/// Names that a sweep of leftovers may take for its own, and the list.
bool IsHiddenWork(const std::string& name) {
  return internal::IsTemporaryName(name) || internal::IsLockName(name) || name == kManifestName;
}

}  // namespace

namespace internal {

std::string Normal(const std::string& path) {
  Walk walk(path);
  const bool absolute = !path.empty() && path[0] == '/';
  for (const std::string& part : PartsOf(absolute ? "" : fs::current_path().string())) walk.Step(part, false);
  const std::vector<std::string> parts = PartsOf(path);
  for (size_t i = 0; i < parts.size(); ++i) walk.Step(parts[i], i + 1 < parts.size() || HasFolderForm(path));
  return walk.End();
}

std::string OneName(const std::string& path) {
  const std::string normal = Normal(path);
  if (!path.empty() && path[0] == '/') return normal;
  return fs::path(normal).lexically_relative(fs::current_path()).string();
}

std::string NameOfFile(const std::string& path) {
  if (path.empty()) throw UsageError("the name of an output is empty; give a path");
  if (HasFolderForm(path)) throw UsageError(path + ": is the name of a folder, a file goes there");
  return OneName(path);
}

}  // namespace internal

std::string PathOnDisk(const std::string& path) { return internal::Normal(path); }

std::string PlainPath(const std::string& path) {
  const std::vector<std::string> parts = PartsOf(path);
  const bool climbs = std::find(parts.begin(), parts.end(), "..") != parts.end();
  return climbs ? internal::OneName(path) : fs::path(path).lexically_normal().string();
}

bool HasFolderForm(const std::string& path) {
  const std::string name = path.substr(path.rfind('/') == std::string::npos ? 0 : path.rfind('/') + 1);
  return !path.empty() && (name.empty() || name == "." || name == "..");
}

bool IsReservedName(const std::string& given) {
  const std::string name = Lower(given), end = kResultEnd;
  const bool result = name.size() >= end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0;
  return result || name == kProvenanceName || BeginsWith(name, ".mvstudio-") || BeginsWith(name, ".mvstudio.");
}

void RequireFreeName(const std::string& path) {
  const std::vector<std::string> parts = PartsOf(internal::Normal(path));
  const bool work = internal::InWorkFolder(path);
  for (const std::string& part : parts) {
    const bool last = &part == &parts.back();
    if (last ? IsReservedName(part) : !work && IsHiddenWork(part))
      throw UsageError(path + ": mvstudio keeps the name " + part + " for its own records; choose another name");
  }
}

void RequireFolderName(const std::string& path) {
  std::error_code ignored;
  const std::string ending = Lower(fs::path(path).extension().string());
  const bool file = std::find(std::begin(kFileEndings), std::end(kFileEndings), ending) != std::end(kFileEndings);
  if (file && !fs::is_directory(path, ignored))
    throw UsageError(path + ": ends in " + ending +
                     ", but a folder is written there; leave the ending out, or make the folder first");
}

std::string OutputName(const std::string& path, OutputKind kind) {
  if (path.empty() || kind == OutputKind::kFile) internal::NameOfFile(path);
  RequireFreeName(path);
  if (kind == OutputKind::kFolder && !HasFolderForm(path)) RequireFolderName(path);
  std::error_code ignored;
  const bool linked = kind != OutputKind::kFile && fs::is_directory(path, ignored);
  const std::string name = internal::OneName(linked ? path + "/" : path);
  RequireFreeName(name);
  const bool stays_folder = kind == OutputKind::kAny && HasFolderForm(path) && name.back() != '/';
  return name + (stays_folder ? "/" : "");
}

}  // namespace mvstudio
