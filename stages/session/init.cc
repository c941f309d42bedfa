#include <charconv>
#include <filesystem>
#include <sstream>

#include "calib/board/board.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/new_folders.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "stages/session/run.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

using dataset::Session;

std::vector<dataset::SessionCamera> CountedCameras(const std::string& text) {
  int count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (error != std::errc() || count < 1 || count > 1000)
    throw UsageError("option 'cameras' " + text + ": a number of cameras is between 1 and 1000");
  std::vector<dataset::SessionCamera> cameras;
  for (int i = 1; i <= count; ++i) {
    cameras.push_back({Format("cam_%02d", i), "", "", 0, 0});
  }
  return cameras;
}

bool IsCount(const std::string& text) {
  const size_t digits = text.find_first_not_of("+-");
  return !text.empty() && (digits == std::string::npos || text.find_first_not_of("0123456789", digits) == std::string::npos);
}

/// "4" is cam_01 to cam_04; else names with commas between them. What looks like a number is never a name.
std::vector<dataset::SessionCamera> NamedCameras(const std::string& text) {
  if (text.empty()) return {};
  if (IsCount(text)) return CountedCameras(text);
  std::vector<dataset::SessionCamera> cameras;
  std::stringstream names(text);
  for (std::string name; std::getline(names, name, ',');) {
    const std::string why = dataset::WhyNotAName(name);
    if (!why.empty()) throw UsageError("option 'cameras': '" + name + "' " + why);
    for (const dataset::SessionCamera& other : cameras) {
      if (other.name == name) throw UsageError("option 'cameras': '" + name + "' is there twice");
    }
    cameras.push_back({name, "", "", 0, 0});
  }
  return cameras;
}

std::string TextIfThere(const std::string& path) { return fs::exists(path) ? ReadFile(path) : ""; }

/// Takes back the link that raw/ became, unless the session was made: its file is another one then.
struct LinkBack {
  explicit LinkBack(const std::string& session_file) : file(session_file), before(TextIfThere(file)) {}
  LinkBack(const LinkBack&) = delete;
  LinkBack& operator=(const LinkBack&) = delete;
  ~LinkBack() {
    if (raw.empty()) return;
    try {
      if (TextIfThere(file) != before) return;
      RemoveOurs({raw});
      if (was_folder) MakeFolder(raw);
    } catch (const std::exception&) {  // on a disk that fails; the next try says what is in the way
    }
  }
  std::string file, before, raw;
  bool was_folder = false;
};

/// Footage that lies elsewhere is not copied: raw/ becomes a link to it. Returns it where it is one.
std::string LinkRaw(const SessionInitOptions& options, LinkBack* back) {
  const fs::path raw = fs::path(options.folder) / "raw";
  std::error_code error;
  if (!fs::equivalent(raw, options.scan, error)) {
    back->raw = raw.string(), back->was_folder = fs::exists(fs::symlink_status(raw));
    PlaceLink(PathOnDisk(options.scan), raw.string());
  }
  return fs::is_symlink(raw) ? raw.string() : "";
}

void RequireRoomForLink(const SessionInitOptions& options) {
  const fs::path raw = fs::path(options.folder) / "raw";
  std::error_code error;
  const fs::file_status there = fs::symlink_status(raw, error);
  if (!fs::exists(there) || fs::equivalent(raw, options.scan, error)) return;
  if (!fs::is_directory(there) || !fs::is_empty(raw))
    throw UsageError("option 'scan' " + options.scan + ": " + raw.string() + " is there already: footage, or a link to it");
}

/// A folder without takes: perhaps it is one.
[[noreturn]] void RefuseScan(const std::string& scan) {
  std::vector<dataset::SessionCamera> cameras;
  dataset::ScanFolder(scan, &cameras);
  if (cameras.empty())
    throw FormatError(scan, "", "holds no footage; expected TAKE/CAMERA.mp4, TAKE/CAMERA/*.png or CAMERA/TAKE.mp4 in it");
  const std::string above = fs::path(PathOnDisk(scan)).parent_path().string();
  throw FormatError(scan, "",
                    "is one take's folder, with footage of " +
                        Join(cameras, ", ", [](const dataset::SessionCamera& camera) { return camera.name; }) +
                        "; give the folder above, option 'scan' " + ShellWord(above) +
                        ", in which each take has such a folder");
}

/// Cameras with footage join those that were named. Beside a number the footage's names are the cameras', unless they all are
/// cam_01 and so on.
void TakeCameras(SessionInitReport* report) {
  std::vector<dataset::SessionCamera>& cameras = report->session.cameras;
  std::vector<dataset::SessionCamera> others;
  for (const dataset::SessionCamera& camera : report->scanned.cameras) {
    if (report->session.FindCamera(camera.name) < 0) others.push_back(camera);
  }
  if (others.empty()) return;
  if (IsCount(report->options.cameras)) {
    report->expected = cameras.size();
    cameras = report->scanned.cameras;
    return;
  }
  for (const dataset::SessionCamera& camera : others) {
    if (!report->options.cameras.empty()) report->unnamed.push_back(camera.name);
    cameras.push_back(camera);
  }
}

void TakeScan(SessionInitReport* report) {
  const SessionInitOptions& options = report->options;
  if (!options.scan.empty()) RequireFolder(options.scan, " (option 'scan')");
  if (!options.scan.empty()) RequireRoomForLink(options);
  report->scanned =
      dataset::ScanRaw(options.scan.empty() ? (fs::path(options.folder) / "raw").string() : options.scan, options.layout);
  if (!options.scan.empty() && report->scanned.takes.empty()) RefuseScan(options.scan);
  report->session.takes = report->scanned.takes;
  TakeCameras(report);
}

Session SessionToInit(const SessionInitOptions& options) {
  Session session;
  session.folder = options.folder;
  session.units = options.units;
  session.board = dataset::BoardWithUnits(options.board, options.units);
  if (!session.board.empty()) calib::ParseBoard(session.board);  // refused now rather than when it is filmed
  if (options.fps_hz > 0) session.fps_hz = options.fps_hz;
  session.cameras = NamedCameras(options.cameras);
  return session;
}

/// Everything that is written; nothing stays of it when a step fails.
void WriteInit(SessionInitReport* report) {
  const SessionInitOptions& options = report->options;
  const fs::path folder = options.folder;
  NewFolders folders;
  folders.Make(options.folder);
  LinkBack back(report->File());
  if (!options.scan.empty()) report->link = LinkRaw(options, &back);
  for (const char* name : {"sync", "calib", "pose2d", "masks", "pose3d", "dataset", "avatar"}) {
    folders.Make((folder / name).string());
  }
  if (options.scan.empty()) folders.Make((folder / "raw").string());
  dataset::WriteSession(report->session, true);
  back.raw.clear();
  dataset::ReadSession(options.folder);  // what was written can be read
  folders.Keep();
}

}  // namespace

SessionInitReport RunSessionInit(const SessionInitOptions& options) {
  SessionInitReport report;
  report.options = options;
  if (fs::exists(report.File()) && !options.overwrite)
    throw UsageError(report.File() + ": exists already; option 'overwrite' replaces it");
  if (options.units != "m" && options.units != "cm" && options.units != "mm") {
    throw UsageError("option 'units' must be m, cm or mm: the unit of the board's squares and of all lengths in the session");
  }
  report.session = SessionToInit(options);
  TakeScan(&report);
  WriteInit(&report);
  return report;
}

}  // namespace mvstudio::stages
