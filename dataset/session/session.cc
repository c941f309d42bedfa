#include "dataset/session/session.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/fields.h"
#include "core/join.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

constexpr ChoiceWords<TakeKind, 3> kTakeKinds = {
    {{TakeKind::kPeople, "people"}, {TakeKind::kBoard, "board"}, {TakeKind::kPlate, "plate"}}};

/// A path with its symbolic links followed as far as it is there.
fs::path Real(const fs::path& path) {
  std::error_code error;
  const fs::path real = fs::weakly_canonical(path, error);
  if (error) throw IoError(path.string(), error.message());
  return real;
}

bool IsWithin(const fs::path& real, const fs::path& real_folder) {
  const auto [end, at] = std::mismatch(real_folder.begin(), real_folder.end(), real.begin(), real.end());
  return end == real_folder.end();
}

[[noreturn]] void Leaves(const Session& session, const std::string& path, const std::string& how) {
  throw FormatError(
      (fs::path(session.folder) / "mvstudio.toml").string(), path,
      how +
          "; footage must lie in the session: copy it there, allow it with option 'allow-outside', or trust it from now "
          "on: mvstudio session trust " +
          session.folder);
}

/// What a pattern begins with, up to the first part that is not there by its very name.
fs::path FixedPart(const fs::path& pattern) {
  fs::path fixed;
  for (const fs::path& part : pattern) {
    if (IsPattern((fixed / part).string())) break;
    fixed /= part;
  }
  return fixed;
}

/// `relative` in the session's folder. Also a link to what is not there yet leads out.
std::string PlaceInSession(const Session& session, const fs::path& relative) {
  fs::path at = session.folder;
  if (session.allow_outside) return (at / relative).string();
  const fs::path real_folder = Real(session.folder);
  for (const fs::path& part : relative) {
    at /= part;
    std::error_code error;
    if (!fs::is_symlink(fs::symlink_status(at, error))) continue;
    if (fs::exists(at, error) && IsWithin(Real(at), real_folder)) continue;
    throw FormatError(
        at.string(), "",
        "is a symbolic link out of the session; make it a folder, allow it with option 'allow-outside', or name another "
        "place with option 'out'");
  }
  return at.string();
}

bool IsTrusted(const Session& session, const fs::path& at) {
  return std::any_of(session.trusted.begin(), session.trusted.end(),
                     [&](const std::string& folder) { return IsWithin(Real(at), folder); });
}

void CheckLink(const Session& session, const std::string& path, const fs::path& at, const fs::path& real_folder) {
  if (!IsWithin(Real(at), real_folder) && !IsTrusted(session, at))
    Leaves(session, path, "a symbolic link leads out of the session (" + at.string() + ")");
}

/// How a path leaves the session by its very words; empty: it does not.
std::string WayOut(const fs::path& path) {
  if (path.is_absolute()) return "is an absolute path";
  const fs::path relative = path.lexically_normal();
  return !relative.empty() && *relative.begin() == ".." ? "leaves the session" : "";
}

/// The images of a folder or pattern are reached one by one.
void CheckImages(const Session& session, const std::string& path, const std::string& joined, const fs::path& real_folder) {
  const bool pattern = IsPattern(joined);
  if (!pattern && !fs::is_directory(joined)) return;
  for (const std::string& file : FilesMatching(joined)) {
    if (pattern || fs::is_symlink(file)) CheckLink(session, path, file, real_folder);
  }
}

/// What the first link out of the session leads to, or the folder of what lies outside.
std::string FolderOutside(const Session& session, const std::string& path, const fs::path& at, const fs::path& real_folder) {
  fs::path link = session.folder;
  for (const fs::path& part : WayOut(path).empty() ? at.lexically_relative(session.folder) : fs::path()) {
    link /= part;
    if (fs::is_symlink(link) && fs::is_directory(link) && !IsWithin(Real(link), real_folder)) return Real(link).string();
  }
  const fs::path real = Real(at);
  return (fs::is_directory(real) ? real : real.parent_path()).string();
}

std::string KnownTakes(const Session& session) {
  return session.takes.empty() ? "none" : Join(session.takes, ", ", &SessionTake::name);
}

}  // namespace

std::string_view ToString(TakeKind kind) { return WordOf(kTakeKinds, kind); }
std::optional<TakeKind> TakeKindFromString(std::string_view text) { return ChoiceOf(kTakeKinds, text); }

double Session::metres_per_unit() const { return units == "mm" ? 1e-3 : units == "cm" ? 1e-2 : 1; }

int Session::FindCamera(const std::string& name) const {
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

const SessionTake& TakeOf(const Session& session, const std::string& name) {
  const SessionTake* only = nullptr;
  int people = 0;
  for (const SessionTake& take : session.takes) {
    if (!name.empty() && take.name == name) return take;
    if (take.kind == TakeKind::kPeople) only = &take, ++people;
  }
  if (!name.empty())
    throw UsageError("option 'take' " + name + ": the session has no such take; it has " + KnownTakes(session));
  if (people == 1) return *only;
  throw UsageError("option 'take' is needed: the session has " + std::to_string(people) +
                   " takes with people (takes: " + KnownTakes(session) + ")");
}

std::string ResolveInSession(const Session& session, const std::string& path, bool allow_outside) {
  allow_outside = allow_outside || session.allow_outside;
  if (path.empty() || path.find('\0') != std::string::npos) Leaves(session, path, "is not a path");
  const std::string way_out = allow_outside ? "" : WayOut(path);
  if (!way_out.empty() && session.trusted.empty()) Leaves(session, path, way_out);  // without a look at what is there
  const fs::path joined = PlainPath((fs::path(session.folder) / path).string());
  const fs::path fixed = FixedPart(joined);
  if (!way_out.empty() && !IsTrusted(session, fixed)) Leaves(session, path, way_out);
  std::error_code error;
  if (!fs::exists(fixed, error)) throw IoError(joined.string(), "no such file or folder (named in mvstudio.toml)");
  if (!allow_outside) {
    const fs::path real_folder = Real(session.folder);
    CheckLink(session, path, fixed, real_folder);
    CheckImages(session, path, joined.string(), real_folder);
  }
  return joined.string();
}

std::vector<std::string> FoldersOutside(const Session& session) {
  std::set<std::string> folders;
  const fs::path real_folder = Real(session.folder);
  const auto add = [&](const std::string& path) {
    if (path.empty()) return;
    const std::string joined = ResolveInSession(session, path, true);
    std::vector<std::string> reached = {FixedPart(joined).string()};
    if (IsPattern(joined) || fs::is_directory(joined)) {
      const std::vector<std::string> files = FilesMatching(joined);
      reached.insert(reached.end(), files.begin(), files.end());
    }
    for (const std::string& at : reached)
      if (!IsWithin(Real(at), real_folder)) folders.insert(FolderOutside(session, path, at, real_folder));
  };
  for (const SessionTake& take : session.takes) {
    for (const SessionFootage& footage : take.footage) add(footage.path), add(footage.plate);
    add(take.timestamps), add(take.sync);
  }
  add(session.calibration);
  return {folders.begin(), folders.end()};
}

std::string CalibrationOf(const Session& session, bool allow_outside) {
  if (!session.calibration.empty()) return ResolveInSession(session, session.calibration, allow_outside);
  for (const char* usual : {"calib/calibration.json", "calibration.json"}) {
    if (fs::exists(fs::path(session.folder) / usual)) return ResolveInSession(session, usual, allow_outside);
  }
  return "";
}

std::string TakeFolder(const Session& session, const std::string& kind, const std::string& take, const std::string& camera) {
  fs::path folder = fs::path(kind) / Slug(take);
  if (!camera.empty()) folder /= Slug(camera);
  return PlaceInSession(session, folder);
}

std::string TimelinePath(const Session& session, const std::string& take) {
  return PlaceInSession(session, fs::path("sync") / (Slug(take) + ".timeline.json"));
}

}  // namespace mvstudio::dataset
