#include "stages/doctor/run.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "dataset/session/session_scan.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

/// Reads the folder itself as a session's raw/: CAMERA/TAKE.mp4 and the like.
void TakeFromRaw(const std::string& path, dataset::Session* session) {
  const dataset::ScannedSession scanned = dataset::ScanRaw(path);
  session->cameras = scanned.cameras;
  session->takes = scanned.takes;
  for (dataset::SessionTake& take : session->takes) {
    for (dataset::SessionFootage& footage : take.footage) {
      for (std::string* file : {&footage.path, &footage.plate}) {
        if (file->rfind("raw/", 0) == 0) file->erase(0, 4);
      }
    }
  }
}

bool IsSession(const std::string& path) { return fs::exists(fs::path(path) / "mvstudio.toml"); }

dataset::Session SessionAt(const std::string& path, InputNotes* notes) {
  if (!fs::exists(path)) throw IoError(path, "no such session or folder");
  if (!fs::is_directory(path) || IsSession(path)) return dataset::ReadSession(path);
  dataset::Session session;
  session.folder = path;
  session.units = "m";
  const dataset::ScannedSession scanned = dataset::ScanSession(path);
  session.cameras = scanned.cameras;
  session.takes = scanned.takes;
  if (scanned.takes.empty()) session.takes = {dataset::ScanFolder(path, &session.cameras)};
  if (session.cameras.empty()) TakeFromRaw(path, &session);
  notes->warnings.push_back({"SES-NONE", path + " holds no mvstudio.toml: checked as a folder of footage",
                             "make a session with mvstudio session init"});
  return session;
}

/// A board that no take shows: the folders were perhaps read the wrong way round.
void WarnOfBoard(const dataset::Session& session, InputNotes* notes) {
  const auto shows_board = [](const dataset::SessionTake& take) { return take.kind == dataset::TakeKind::kBoard; };
  if (session.board.empty() || std::any_of(session.takes.begin(), session.takes.end(), shows_board)) return;
  notes->warnings.push_back({"SES-BOARD", "the session has a board (" + session.board + ") and no take of kind board",
                             "give a take kind = \"board\" in mvstudio.toml; if cameras and takes are exchanged, run "
                             "session init again with option 'layout'"});
}

}  // namespace

DoctorReport RunDoctor(const DoctorOptions& options, const RunContext& run) {
  DoctorReport report;
  const bool folder = !options.path.empty() && fs::is_directory(options.path);
  report.machine = ExamineMachine(folder ? options.path : ".");
  if (options.path.empty()) return report;
  const dataset::Session session = SessionAt(options.path, &report.notes);
  report.session = dataset::InspectSession(session, options.inspect, run);
  if (!IsSession(session.folder) && session.cameras.empty()) {
    report.session->findings.push_back({"SES-NO-FOOTAGE", options.path + ": no footage was found in it",
                                        "name a session, or a folder with TAKE/CAMERA.mp4, CAMERA/TAKE.mp4 or CAMERA.mp4",
                                        true});
  }
  report.notes.inputs = {options.path};
  WarnOfBoard(session, &report.notes);
  return report;
}

}  // namespace mvstudio::stages
