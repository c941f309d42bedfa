#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calib/bundle/bundle.h"
#include "core/choice/auto_on_off.h"
#include "core/choice/option_group.h"
#include "core/fields.h"
#include "geometry/lens/camera.h"

/// Options of Calibrate. Beside each type stand its words as text: ToString, and FromString that throws UsageError.
namespace mvstudio::calib {

/// Which cameras have one lens: what held-out boards say, none, all, or groups "a,b;c,d".
struct LensSharing {
  enum class Kind { kAuto, kNone, kAll, kGroups };
  Kind kind = Kind::kAuto;
  std::vector<std::vector<std::string>> groups;  ///< names of cameras; for kGroups alone
};
std::string ToString(const LensSharing& sharing);
void FromString(const std::string& text, LensSharing* sharing);

/// Whether cameras may be late by a fraction of a frame: what held-out frames say; yes, by a constant one; yes, and their
/// clocks may run at different rates; no.
enum class TimeOffsetChoice { kAuto, kOn, kClocks, kNone };
std::string_view ToString(TimeOffsetChoice time_offset);
void FromString(const std::string& text, TimeOffsetChoice* time_offset);

/// What defines the world: "camera", "camera:NAME" or "board:FRAME".
struct WorldOrigin {
  std::string camera;                  ///< its frame `cam` is `world`; empty: the first one's
  std::optional<int64_t> board_frame;  ///< instead: the first board as it lies in this frame, face up
};
std::string ToString(const WorldOrigin& origin);
void FromString(const std::string& text, WorldOrigin* origin);

/// Time steps that are held out and check the solution: `first`, `first` + `step`, …; "every:N" begins with N - 1,
/// "every:N:K" with K.
struct HoldoutRule {
  int step = 0;  ///< 0: none
  int first = 0;
};
std::string ToString(const HoldoutRule& rule);
void FromString(const std::string& text, HoldoutRule* rule);

/// From `frame_idx` on the camera stands elsewhere, and has another lens if `second_lens`: "NAME:FRAME" or
/// "NAME:FRAME:lens". The later part is called NAME@FRAME.
struct CameraSplit {
  std::string camera;
  int64_t frame_idx = 0;
  bool second_lens = false;
};
std::string ToString(const CameraSplit& split);
void FromString(const std::string& text, CameraSplit* split);

/// What stays as CalibrateInput::start has it: "lenses", "poses", or with names "lenses:a,b".
struct HeldPart {
  enum class What { kLenses, kPoses };
  What what = What::kLenses;
  std::vector<std::string> cameras;  ///< empty: all
};
std::string ToString(const HeldPart& part);
void FromString(const std::string& text, HeldPart* part);

/// Who solves the joint adjustment; kMrcal: libmrcal.
enum class Engine { kMvstudio, kMrcal };
std::string_view ToString(Engine engine);
void FromString(const std::string& text, Engine* engine);

struct CalibrateOptions {
  std::optional<geometry::LensModel> model;  ///< none: the simplest that held-out boards justify
  LensSharing share_intrinsics;
  AutoOnOff warp = AutoOnOff::kAuto;     ///< two parameters for the warp of each board
  AutoOnOff stretch = AutoOnOff::kAuto;  ///< two parameters for the shear and aspect of each board
  TimeOffsetChoice time_offset = TimeOffsetChoice::kAuto;
  bool seek_numbers = true;  ///< whether cameras that count frames at other rates, or lost some, are looked for; off once they
                             ///< were
  AutoOnOff free_boards = AutoOnOff::kAuto;  ///< several boards move against each other: each has a pose of its own in every
                                             ///< time step; auto: where that alone explains the corners
  WorldOrigin world;
  HoldoutRule holdout;
  bool intrinsics_only = false;       ///< lenses alone: cameras are not placed
  int holdout_folds = 10;             ///< folds of the held-out error; 0 leaves it out
  int holdout_views = 60;             ///< maximum number of views per camera in the held-out error
  double need_px = 0;                 ///< of projections at the image's sides, see PixelLimitsOf
  std::vector<CameraSplit> split_at;  ///< cameras that moved, each split in two
  bool motions = true;                ///< look for cameras that moved or whose lens changed
  std::vector<HeldPart> fix;
  Engine engine = Engine::kMvstudio;
  BundleOptions bundle;
};

template <class Visitor>
void VisitFields(Visitor&& visit, CalibrateOptions& o) {
  StartGroup(visit, "Lenses");
  visit("model", o.model, "a lens model (docs/formulation.md), or auto: the simplest that held-out boards justify");
  visit("share-intrinsics", o.share_intrinsics,
        "one lens for several cameras: auto (if held-out boards say so), none, all, or a,b;c,d");
  StartGroup(visit, "Board");
  visit("warp", o.warp, "two numbers for the bend of the board: auto (if held-out boards say so), on or off");
  visit("stretch", o.stretch, "two numbers for shear and aspect of the board: auto (if held-out boards say so), on or off");
  StartGroup(visit, "Rig");
  visit("time-offset", o.time_offset,
        "offsets in time between cameras: auto (if held-out frames say so), on (constant), clocks (with drift) or none");
  visit("free-boards", o.free_boards,
        "several boards that move against each other: auto (if that alone explains the corners), on or off");
  visit("world", o.world, "camera, camera:NAME, or board:FRAME (board lying face up: z up, x along its columns)");
  StartGroup(visit, "Held-out boards");
  visit("holdout", o.holdout,
        "every:N keeps every Nth time step out of the solution and checks the rig on it; every:N:K begins with time step K "
        "(from 0)");
  StartGroup(visit, "Lenses");
  visit("intrinsics-only", o.intrinsics_only, "calibrate the lenses alone");
  StartGroup(visit, "Held-out boards");
  visit("holdout-folds", o.holdout_folds, "folds of the held-out error; 0 leaves it out");
  visit("holdout-views", o.holdout_views, "maximum number of views per camera in the held-out error");
  StartGroup(visit, "Lenses");
  visit("need", o.need_px,
        "px by which projections at the image's sides may be uncertain without a warning (0: 0.2 % of the image's diagonal, at "
        "least 1 px)");
  StartGroup(visit, "Rig");
  visit("split-at", o.split_at,
        "CAMERA:FRAME: from this frame on the camera stands elsewhere and counts as another one, CAMERA@FRAME, with the same "
        "lens; CAMERA:FRAME:lens when the lens changed (repeatable)");
  visit("motions", o.motions, "look for cameras that moved, or whose lens changed, while the boards were filmed");
  visit("fix", o.fix, "keep as in the given calibration: lenses, poses, or lenses:NAME,NAME (repeatable)");
  StartGroup(visit, "Adjustment");
  visit("engine", o.engine, "mvstudio, or mrcal: the joint adjustment by libmrcal, as a second opinion");
  VisitFields(visit, o.bundle);
}

}  // namespace mvstudio::calib
