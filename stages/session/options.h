#pragma once

#include <string>

#include "core/choice/option_style.h"
#include "dataset/session/session_scan.h"
#include "dataset/session/timeline_source.h"
#include "dataset/verify/session_check.h"

/// Sessions that are made, shown, trusted and given a timeline: what a caller gives. The lists are without the folder.
namespace mvstudio::stages {

constexpr char kOutsideHelp[] = "allow the session to name files outside its folder";

struct SessionInitOptions {
  std::string folder;
  std::string units;    ///< m, cm or mm
  std::string cameras;  ///< a number, or names with commas; empty: those with footage
  std::string board;    ///< empty: none
  std::string scan;     ///< folder of footage; empty: the session's raw/
  dataset::SessionLayout layout = dataset::SessionLayout::kAuto;
  double fps_hz = 0;  ///< of image folders; 0: not stated
  bool overwrite = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SessionInitOptions& o) {
  visit("units", o.units, "m, cm or mm: of the board's squares and of all lengths in the session");
  visit("cameras", o.cameras, "how many (cam_01, cam_02, …), or their names with commas between them");
  visit("board", o.board, "the calibration board, as calibrate option 'board' takes it");
  visit("scan", o.scan,
        "folder with TAKE/CAMERA.mp4 or TAKE/CAMERA/*.png, or with CAMERA/TAKE.mp4; another than FOLDER/raw is linked to, "
        "not copied");
  VisitStyled(
      visit, OptionStyle::kUnset, "layout", o.layout,
      "how the folders are read: take-first (TAKE/CAMERA.mp4), camera-first (CAMERA/TAKE.mp4), or auto: by their names");
  VisitStyled(visit, OptionStyle::kUnset, "fps", o.fps_hz, "Hz; frame rate of image folders");
  VisitStyled(visit, OptionStyle::kSwitch, "overwrite", o.overwrite, "replace an existing mvstudio.toml");
}

struct SessionShowOptions {
  std::string folder;
  bool decode = false, allow_outside = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SessionShowOptions& o) {
  VisitStyled(visit, OptionStyle::kSwitch, "decode", o.decode, "decode every frame, instead of reading time stamps only");
  VisitStyled(visit, OptionStyle::kSwitch, "allow-outside", o.allow_outside, kOutsideHelp);
}

struct SessionTrustOptions {
  std::string folder;
  bool forget = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SessionTrustOptions& o) {
  VisitStyled(visit, OptionStyle::kSwitch, "forget", o.forget, "take the trust back");
}

struct SessionTimelineOptions {
  std::string folder;
  std::string take;  ///< empty: the only one with people
  std::string out;   ///< file; empty: in the session
  dataset::TakeTimelineOptions how;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SessionTimelineOptions& o) {
  visit("take", o.take, "its only take with people unless given");
  VisitStyled(visit, OptionStyle::kFile, "out", o.out, "file; FOLDER/sync/TAKE.timeline.json unless given");
  visit("reference", o.how.timeline.reference, "camera whose frames count the time steps");
  visit("max-residual-ms", o.how.timeline.max_residual_ms,
        "time steps farther from a frame have none; 0: half a frame of that camera");
  VisitStyled(visit, OptionStyle::kSwitch, "find-repeats", o.how.find_repeats,
              "look for frames that only repeat the image before; decodes all");
  VisitStyled(visit, OptionStyle::kSwitch, "allow-outside", o.how.allow_outside, kOutsideHelp);
}

}  // namespace mvstudio::stages
