#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/result.h"
#include "dataset/build/build.h"
#include "dataset/session/session.h"
#include "dataset/time/timeline.h"

/// The footage of one take: the input of every command that reads pictures of people.
namespace mvstudio::app {

struct TakeArguments {
  std::vector<std::string> video;   ///< CAMERA=FILE
  std::vector<std::string> images;  ///< CAMERA=FOLDER or CAMERA=PATTERN
  std::vector<std::string> plate;   ///< CAMERA=FILE
  std::string session;              ///< folder with mvstudio.toml, instead of the three above
  std::string take;                 ///< empty: the session's only take with people
  bool allow_outside = false;       ///< footage may lie outside the session
  bool with_timeline = true;        ///< footage carries the take's timeline; false: frames are numbered as they were recorded
  bool make_timeline = true;        ///< give the footage a timeline though none was written; false: only the written one
};

struct TakeInput {
  std::vector<dataset::CameraFootage> footage;  ///< a camera each
  std::string calibration;                      ///< path; empty when nothing names one
  std::optional<dataset::Session> session;      ///< when --session was given
  std::string take;                             ///< its name; empty without --session
  double fps_hz = 0;                            ///< as the session states it; 0: not stated

  /// SESSION/KIND/TAKE/CAMERA; `kind` is "pose2d" or "masks". Empty without --session.
  std::string Folder(const std::string& kind, const std::string& camera = "") const;
};

/// sync/TAKE.timeline.json; without it, and when the take has time stamps or a sync file and `make` says so, one made now; else
/// null. What is doubtful becomes a warning.
std::shared_ptr<const dataset::Timeline> TimelineOf(const dataset::Session& session, const dataset::SessionTake& take,
                                                    bool allow_outside, bool make, CommandResult* result);

/// Names the footage in result->inputs; the session's warnings become warnings of the result. Throws UsageError for a plate
/// without footage, a camera given twice, --session together with footage; what ReadSession and ResolveInSession throw. Plates
/// of a session may be named again by --plate. The footage of a session carries sync/TAKE.timeline.json, or a timeline made now
/// when the take has time stamps or a sync file.
TakeInput ReadTakeInput(const TakeArguments& arguments, CommandResult* result);

}  // namespace mvstudio::app
