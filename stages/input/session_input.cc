#include "stages/input/session_input.h"

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "calib/board/sets.h"
#include "core/error.h"
#include "dataset/footage/frames.h"
#include "dataset/session/timeline_source.h"
#include "stages/input/take_frames.h"
#include "stages/input/take_input.h"

namespace mvstudio::stages {
namespace {

/// The take named, or the only one with a board.
const dataset::SessionTake& BoardTake(const dataset::Session& session, const std::string& name) {
  if (!name.empty()) return dataset::TakeOf(session, name);
  const dataset::SessionTake* board = nullptr;
  for (const dataset::SessionTake& take : session.takes) {
    if (take.kind != dataset::TakeKind::kBoard) continue;
    if (board) throw UsageError(session.folder + " has several takes with a board: name one with option 'take'");
    board = &take;
  }
  if (!board) throw UsageError(session.folder + " has no take of kind \"board\" in mvstudio.toml; name one with option 'take'");
  return *board;
}

void AddWarnings(const dataset::Session& session, InputNotes* notes) {
  for (const std::string& warning : session.warnings)
    notes->warnings.push_back({"SES-KEY", warning, "see docs/formats.md for the keys of mvstudio.toml"});
}

/// Frames of a track under new numbers; those without one are left out. True when any number changed.
bool Renumber(const std::vector<std::pair<int64_t, int64_t>>& numbers, dataset::Pose2dTrack* track) {
  std::map<int, std::vector<dataset::Person2d>> frames;
  bool changed = false;
  for (const auto& [from, to] : numbers) {
    const auto at = track->frames.find(static_cast<int>(from));
    if (at == track->frames.end()) continue;
    frames[static_cast<int>(to)] = at->second;
    changed = changed || from != to;
  }
  changed = changed || frames.size() != track->frames.size();
  track->frames = std::move(frames);
  return changed;
}

}  // namespace

std::optional<FoundTake> FindTake(const SessionArguments& arguments, InputNotes* notes) {
  if (arguments.session.empty() && !arguments.take.empty()) throw UsageError("option 'take' needs option 'session'");
  if (arguments.session.empty()) return std::nullopt;
  FoundTake found{dataset::ReadSession(arguments.session, arguments.allow_outside), {}};
  found.take = dataset::TakeOf(found.session, arguments.take);
  AddWarnings(found.session, notes);
  return found;
}

void FillPoses(const FoundTake& found, const SessionArguments& arguments, PoseArguments* pose) {
  if (pose->calib.empty()) pose->calib = dataset::CalibrationOf(found.session, arguments.allow_outside);
  if (pose->calib.empty()) RefuseWithoutCalibration(found.session.folder);
  if (!pose->pose2d.empty() || !pose->points2d.empty()) return;
  for (const dataset::SessionFootage& f : found.take.footage) {
    const std::string folder = dataset::TakeFolder(found.session, "pose2d", found.take.name, f.camera);
    if (std::filesystem::is_directory(folder)) pose->pose2d.push_back({f.camera, folder});
  }
  if (pose->pose2d.empty()) {
    throw UsageError(dataset::TakeFolder(found.session, "pose2d", found.take.name) +
                     ": no 2D poses; run mvstudio pose2d option 'session' " + found.session.folder + " first");
  }
}

void LeaveOutUncalibrated(PoseArguments* pose, InputNotes* notes) {
  std::vector<std::string> cameras, kept;
  for (const NamedPath& named : pose->pose2d) cameras.push_back(named.name);
  if (cameras.empty() || !NameUncalibrated(pose->calib, cameras, &kept, notes)) return;
  const auto is_out = [&](const NamedPath& named) { return std::find(kept.begin(), kept.end(), named.name) == kept.end(); };
  pose->pose2d.erase(std::remove_if(pose->pose2d.begin(), pose->pose2d.end(), is_out), pose->pose2d.end());
}

std::vector<std::string> CamerasWithoutBoard(const SessionArguments& arguments) {
  const dataset::Session session = dataset::ReadSession(arguments.session, arguments.allow_outside);
  const auto& board = BoardTake(session, arguments.take).footage;
  std::vector<std::string> without;
  for (const dataset::SessionTake& take : session.takes) {
    if (take.kind != dataset::TakeKind::kPeople) continue;
    for (const dataset::SessionFootage& f : take.footage) {
      const auto same = [&](const dataset::SessionFootage& b) { return b.camera == f.camera; };
      const bool told = std::find(without.begin(), without.end(), f.camera) != without.end();
      if (!told && std::none_of(board.begin(), board.end(), same)) without.push_back(f.camera);
    }
  }
  return without;
}

void FillCorners(const SessionArguments& arguments, CornerArguments* corners, InputNotes* notes) {
  if (arguments.session.empty() && !arguments.take.empty()) throw UsageError("option 'take' needs option 'session'");
  corners->boards = calib::SingleBoards(corners->boards);
  if (arguments.session.empty()) return;
  const dataset::Session session = dataset::ReadSession(arguments.session, arguments.allow_outside);
  AddWarnings(session, notes);
  if (corners->boards.empty()) {
    if (session.board.empty())
      throw UsageError(session.folder + "/mvstudio.toml names no board: add board = \"…\", or give option 'board'");
    std::istringstream boards(session.board);
    for (std::string board; boards >> board;)
      corners->boards.push_back(calib::ParseBoard(dataset::BoardWithUnits(board, session.units)));
    corners->boards = calib::SingleBoards(corners->boards);
  }
  if (!corners->cameras.empty() || !corners->corners.empty()) return;
  const dataset::SessionTake& take = BoardTake(session, arguments.take);
  for (const dataset::SessionFootage& f : take.footage)
    corners->cameras.push_back({f.camera, dataset::ResolveInSession(session, f.path, arguments.allow_outside)});
  if (corners->cameras.empty()) throw UsageError("take " + take.name + " of " + session.folder + " has no footage");
  if (corners->cameras.size() > 1) corners->timeline = TimelineOf(session, take, arguments.allow_outside, true, notes);
}

bool RenumberByClock(const FoundTake& found, const SessionArguments& arguments, PoseInput* input) {
  bool changed = false;
  for (dataset::Pose2dTrack& track : input->tracks) {
    for (const dataset::SessionFootage& f : found.take.footage) {
      if (f.camera != track.camera) continue;
      const std::string path = dataset::ResolveInSession(found.session, f.path, arguments.allow_outside);
      if (!dataset::ListFootage(path).is_video) continue;
      changed |= Renumber(dataset::TicksOfFrames(dataset::ReadFootageTimes(f.camera, path, 30)), &track);
    }
  }
  return changed;
}

bool RenumberByTimeline(const dataset::Timeline& timeline, PoseInput* input) {
  bool changed = false;
  for (dataset::Pose2dTrack& track : input->tracks) {
    const dataset::CameraTimeline* camera = timeline.Find(track.camera);
    if (camera) changed |= Renumber(dataset::TimeStepsOfFrames(*camera), &track);
  }
  return changed;
}

}  // namespace mvstudio::stages
