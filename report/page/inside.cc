#include "report/page/inside.h"

#include <algorithm>
#include <deque>
#include <filesystem>

namespace mvstudio::report {
namespace fs = std::filesystem;
namespace {

constexpr int kMaxLinks = 40;

/// What stands behind `folder` in the absolute `path`, by either name of the folder.
std::optional<fs::path> Behind(const fs::path& folder, const fs::path& path) {
  std::error_code ignored;
  for (const fs::path& name : {fs::canonical(folder, ignored), fs::absolute(folder, ignored).lexically_normal()}) {
    const auto [end, rest] = std::mismatch(name.begin(), name.end(), path.begin(), path.end());
    if (name.empty() || (end != name.end() && !(end->empty() && std::next(end) == name.end()))) continue;
    fs::path behind;
    for (auto part = rest; part != path.end(); ++part) behind /= *part;
    return behind;
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> InsideFolder(const std::string& folder, const std::string& path) {
  const fs::path root(folder);
  fs::path inside;  // without links, relative to the folder
  std::deque<fs::path> parts;
  int links = 0;
  const auto enter = [&](fs::path next) {
    if (next.is_absolute()) {
      const auto behind = Behind(root, next);
      if (!behind) return false;
      next = *behind, inside.clear();
    }
    parts.insert(parts.begin(), next.begin(), next.end());
    return true;
  };
  if (!enter(path)) return std::nullopt;
  while (!parts.empty()) {
    const fs::path part = parts.front();
    parts.pop_front();
    if (part.empty() || part == ".") continue;
    if (part == "..") {
      if (inside.empty()) return std::nullopt;
      inside = inside.parent_path();
      continue;
    }
    std::error_code error;
    const fs::path here = root / inside / part;
    if (!fs::is_symlink(fs::symlink_status(here, error))) {
      inside /= part;
    } else if (++links > kMaxLinks || !enter(fs::read_symlink(here, error)) || error) {
      return std::nullopt;
    }
  }
  return (root / inside).string();
}

}  // namespace mvstudio::report
