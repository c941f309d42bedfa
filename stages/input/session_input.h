#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dataset/session/session.h"
#include "dataset/time/timeline.h"
#include "stages/input/corner_input.h"
#include "stages/input/pose_input.h"
#include "stages/input_notes.h"

/// Values that commands on boards and on 2D joints take from a session for flags that were not given. (Footage of people:
/// stages/input/take_input.h.)
namespace mvstudio::stages {

struct SessionArguments {
  std::string session, take;
  bool allow_outside = false;
};

/// `what` comes from the session; without option 'take' its only take with `whom` is meant.
template <class Visitor>
void VisitSession(Visitor& visit, SessionArguments& o, const std::string& what, const std::string& whom) {
  StartGroup(visit, "Session");
  visit("session", o.session, "folder with mvstudio.toml: " + what + " come from it");
  visit("take", o.take, "take of the session; its only one with " + whom + " unless given");
  VisitStyled(visit, OptionStyle::kSwitch, "allow-outside", o.allow_outside,
              "allow the session to name files outside its folder");
}

struct FoundTake {
  dataset::Session session;
  dataset::SessionTake take;
};

/// The take with people; empty without --session. The session's warnings become warnings of the result.
std::optional<FoundTake> FindTake(const SessionArguments& arguments, InputNotes* notes);

/// Fills --calib, and --pose2d from the folders pose2d/TAKE/CAMERA. Throws UsageError when there are no poses.
void FillPoses(const FoundTake& found, const SessionArguments& arguments, PoseArguments* pose);

/// Takes the poses of cameras that the session's calibration lacks out and names them (CAL-LEFTOUT, exit 6). Throws FormatError
/// when fewer than two cameras would stay.
void LeaveOutUncalibrated(PoseArguments* pose, InputNotes* notes);

/// Cameras of the session that film people and have no footage in the take with the board.
std::vector<std::string> CamerasWithoutBoard(const SessionArguments& arguments);

/// Fills --board and --camera from the take with the board, and its timeline where there is one (TimelineOf of take_input.h).
void FillCorners(const SessionArguments& arguments, CornerArguments* corners, InputNotes* notes);

/// Converts frame numbers of 2D poses, which are those of the footage without dropped frames, to ticks of each camera's
/// clock. True when any changed.
bool RenumberByClock(const FoundTake& found, const SessionArguments& arguments, PoseInput* input);

/// Same to time steps of a timeline; false without change.
bool RenumberByTimeline(const dataset::Timeline& timeline, PoseInput* input);

}  // namespace mvstudio::stages
