#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "core/fields.h"
#include "dataset/build/build.h"
#include "dataset/session/session.h"
#include "dataset/time/timeline.h"
#include "stages/input_notes.h"
#include "stages/words.h"

/// The footage of one take: the input of every command that reads images of people.
namespace mvstudio::stages {

struct TakeArguments {
  std::vector<NamedPath> video;   ///< files
  std::vector<NamedPath> images;  ///< folders or patterns
  std::vector<NamedPath> plate;   ///< files
  std::string session;            ///< folder with mvstudio.toml, instead of the three above
  std::string take;               ///< empty: the session's only take with people
  bool allow_outside = false;     ///< footage may lie outside the session
  bool with_timeline = true;      ///< footage carries the take's timeline; false: frames are numbered as they were recorded
  bool make_timeline = true;      ///< make a timeline if none was written; false: only the written one
};

template <class Visitor>
void VisitFields(Visitor&& visit, TakeArguments& o) {
  StartGroup(visit, "Footage");
  VisitStyled(visit, OptionStyle::kRepeated, "video", o.video, "CAMERA=FILE; repeat for each camera");
  visit("images", o.images, "CAMERA=FOLDER or CAMERA=PATTERN; the number in an image's name is its frame");
  visit("plate", o.plate, "CAMERA=FILE: image of the empty scene");
  visit("session", o.session, "folder with mvstudio.toml: footage, plates and calibration come from it");
  visit("take", o.take, "take of the session; its only one with people unless given");
  VisitStyled(visit, OptionStyle::kSwitch, "allow-outside", o.allow_outside,
              "allow the session to name files outside its folder");
}

struct TakeInput {
  std::vector<dataset::CameraFootage> footage;  ///< one per camera
  std::string calibration;                      ///< path; empty when none is named
  std::optional<dataset::Session> session;      ///< when --session was given
  std::string take;                             ///< its name; empty without --session
  double fps_hz = 0;                            ///< as the session states it; 0: not stated

  /// SESSION/KIND/TAKE/CAMERA; `kind` is "pose2d" or "masks". Empty without --session.
  std::string Folder(const std::string& kind, const std::string& camera = "") const;
  /// Of footage and plates; some may be empty.
  std::vector<std::string> Paths() const;
};

/// Two cameras cannot have filmed the same file: masks, joints, boards and images of one of them would be the other's. Throws
/// FormatError.
void RefuseSameFootage(const std::vector<NamedPath>& footage, bool of_session);

/// Takes the footage of cameras that a session's calibration lacks out, names them (CAL-LEFTOUT) and makes the result partial.
/// Does nothing without --session or calibration. Throws FormatError when fewer than two cameras would stay.
void LeaveOutUncalibrated(const std::string& calibration, TakeInput* take, InputNotes* notes);
/// Throws UsageError that says how to get one; `session`: its folder, empty without one.
[[noreturn]] void RefuseWithoutCalibration(const std::string& session);
/// True where some of `cameras` stay out; `kept` are those that the calibration has.
bool NameUncalibrated(const std::string& calibration, const std::vector<std::string>& cameras, std::vector<std::string>* kept,
                      InputNotes* notes);

/// Reads sync/TAKE.timeline.json. Without it, makes a timeline if the take has time stamps or a sync file and `make` is
/// set; else null. Conflicts become warnings.
std::shared_ptr<const dataset::Timeline> TimelineOf(const dataset::Session& session, const dataset::SessionTake& take,
                                                    bool allow_outside, bool make, InputNotes* notes);

/// Reads the footage's names and adds them to notes->inputs; the session's warnings become warnings of the result. Throws
/// UsageError for a plate without footage, a camera given twice, or --session together with footage, FormatError for one
/// recording under two names, and what ReadSession and ResolveInSession throw. --plate may replace plates of a session. The
/// footage of a session has sync/TAKE.timeline.json, or a timeline made now when the take has time stamps or a sync file.
TakeInput ReadTakeInput(const TakeArguments& arguments, InputNotes* notes);

}  // namespace mvstudio::stages
