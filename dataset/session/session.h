#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// A session: one folder with `mvstudio.toml`, which states the unit of lengths, the cameras, what was filmed and where
/// the footage is. Layout and keys: docs/formats.md.
namespace mvstudio::dataset {

struct SessionCamera {
  std::string name;
  std::string serial;               ///< as printed on the camera, or its id in tables of time stamps; may be empty
  std::string lens;                 ///< a note; may be empty
  int width_px = 0, height_px = 0;  ///< 0: not stated
};

/// The footage of one camera in one take; paths as in the file, relative to the session's folder.
struct SessionFootage {
  std::string camera;
  std::string path;   ///< video, folder or pattern of images
  std::string plate;  ///< clean plate: image of the empty scene; may be empty
};

/// What was filmed.
enum class TakeKind { kPeople, kBoard, kPlate };
std::string_view ToString(TakeKind kind);  ///< "people", "board", "plate"
std::optional<TakeKind> TakeKindFromString(std::string_view text);

struct SessionTake {
  std::string name;
  TakeKind kind = TakeKind::kPeople;
  std::optional<double> fps_hz;         ///< instead of the session's
  std::string timestamps;               ///< table of time stamps on a common clock; may be empty
  std::string sync;                     ///< sync.json; empty: sync/TAKE/sync.json if it exists
  std::vector<SessionFootage> footage;  ///< at most one per camera, in the cameras' order
};

/// A flag of a command line, without its dashes. No value: a switch; several: it is given several times.
struct SessionSetting {
  std::string key;
  std::vector<std::string> values;
};

struct Session {
  std::string folder;                ///< folder of mvstudio.toml
  std::string units;                 ///< "m", "cm" or "mm"
  std::string source;                ///< a note; may be empty
  std::string board;                 ///< as accepted by `calib::ParseBoard`; several with blanks between; may be empty
  std::string calibration;           ///< relative path; empty: calib/calibration.json if it exists
  std::optional<double> fps_hz;      ///< of all footage that does not state it
  bool allow_outside = false;        ///< the caller allows paths outside the folder; the session file itself cannot
  std::vector<std::string> trusted;  ///< folders outside that it may read (dataset/session/trust.h), links followed
  std::vector<SessionCamera> cameras;
  std::vector<SessionTake> takes;
  std::map<std::string, std::vector<SessionSetting>>
      settings;                       ///< [run.STAGE]: what `mvstudio run` adds to a stage's command line
  std::vector<std::string> warnings;  ///< one line each, with the place in the file: unknown keys and the like

  double metres_per_unit() const;
  int FindCamera(const std::string& name) const;  ///< -1: none
};

/// Reads FOLDER/mvstudio.toml (or that file itself). Throws IoError, FormatError with line and column: syntax, a missing
/// or unknown unit, names that are not valid file names, a repeated camera or take, footage of a camera that is not
/// listed.
Session ReadSession(const std::string& folder_or_file, bool allow_outside = false);

/// The text of mvstudio.toml; reading it gives the same session. With `comments`, explains each key, also those omitted.
std::string SessionText(const Session& session, bool comments = false);

/// FOLDER/mvstudio.toml, atomically.
void WriteSession(const Session& session, bool comments = false);

/// Throws UsageError that lists the existing takes. An empty name selects the only take with people.
const SessionTake& TakeOf(const Session& session, const std::string& name);

/// An existing path (or pattern) of the session, joined with its folder. Throws FormatError when it leaves the session by
/// `..`, an absolute path or a symbolic link, also for a single image in a folder. `allow_outside`, here or in the
/// session, permits it, and so does a trusted folder in which it lies.
std::string ResolveInSession(const Session& session, const std::string& path, bool allow_outside = false);

/// The folders outside the session in which what it reads lies, links followed, sorted: what a link in the session leads to, or
/// the folder of a file. Throws IoError for what is missing.
std::vector<std::string> FoldersOutside(const Session& session);

/// The calibration that the session names, or calib/calibration.json; empty when there is none.
std::string CalibrationOf(const Session& session, bool allow_outside = false);

/// SESSION/pose2d/TAKE/CAMERA and its siblings: `kind` is "pose2d", "masks"; without camera the take's folder. It need not
/// exist. Results are written there, so FormatError is thrown when a symbolic link on the way leads out of the session,
/// unless the session has `allow_outside`.
std::string TakeFolder(const Session& session, const std::string& kind, const std::string& take,
                       const std::string& camera = "");

/// SESSION/sync/TAKE.timeline.json; links as above.
std::string TimelinePath(const Session& session, const std::string& take);

/// A board's description in which every length has a unit: those without one get `units`.
std::string BoardWithUnits(const std::string& board, const std::string& units);

/// The name itself when it consists of letters, digits, `.`, `_` and `-` and does not begin with `-` or `.`. Otherwise
/// such a name made from it and its digest, so that different names stay different. At most 80 bytes.
std::string Slug(const std::string& name);

/// Why `name` is not valid for a camera or a take; empty if it is. Invalid: empty, not UTF-8, control characters, `/`,
/// `\`, `=`, longer than 128 bytes.
std::string WhyNotAName(const std::string& name);

}  // namespace mvstudio::dataset
