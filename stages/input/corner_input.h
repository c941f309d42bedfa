#pragma once

#include <memory>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/corners/corner_files.h"
#include "calib/detect/detect_footage.h"
#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "core/progress.h"
#include "dataset/time/timeline.h"
#include "stages/input_notes.h"
#include "stages/words.h"

namespace mvstudio::stages {

/// Source of board corners: footage of --camera, searched for --board, or a file, --corners.
struct CornerArguments {
  std::vector<calib::Board> boards;
  std::vector<NamedPath> cameras;
  std::string corners;
  std::vector<std::string> mirrored;  ///< names of cameras whose images are flipped left-right
  std::string timestamps;             ///< table of the footage's times on one clock; empty: none
  calib::FootageOptions footage;
  calib::CornerFileOptions corner_files;
  std::shared_ptr<const dataset::Timeline> timeline;  ///< of the footage; null: equal frame numbers are one time step
};

template <class Visitor>
void VisitFields(Visitor&& visit, CornerArguments& o) {
  StartGroup(visit, "Boards and footage");
  visit("board", o.boards,
        "chessboard:COLSxROWS:SQUARE (inner corners), charuco:COLSxROWS:SQUARE:MARKER[:DICT], aprilgrid:…, tag:… or "
        "grid:… (docs/boards.md); repeat for boards that are fixed to each other");
  visit("camera", o.cameras, "NAME=PATH: a video, a folder or a pattern in quotes; repeat for each camera");
  visit("corners", o.corners, "a file of corners found before, instead of footage (docs/corner-files.md)");
  VisitStyled(visit, OptionStyle::kList, "mirrored", o.mirrored,
              "names of cameras, with commas, whose images are flipped left-right: they are calibrated as if they were not");
  visit("timestamps", o.timestamps,
        "table of the frames' times on one clock (CSV, docs/formats.md): boards are paired by time, not by number");
  VisitFields(visit, o.footage);
  StartGroup(visit, "Boards and footage");
  VisitFields(visit, o.corner_files);
}

/// Paths of the footage and of the file of corners, as far as they are named.
std::vector<std::string> CornerPaths(const CornerArguments& arguments);

struct CornerInput {
  calib::CalibrateInput input;
  std::vector<calib::FootageDetections> found;  ///< of footage only
};

/// The timeline of a table of time stamps, where one is given, in place of any other; to be called when the footage is known.
/// Throws UsageError without footage, and as ReadTimestamps and BuildTimeline do.
void FillTimeline(CornerArguments* arguments, InputNotes* notes);

/// Reads corners from either source, those of mirrored cameras as in images that are not flipped; image sizes are 0 where a
/// corner file does not state them. Notes become warnings, files inputs. Throws UsageError, IoError, FormatError.
CornerInput ReadCornerInput(const CornerArguments& arguments, const RunContext& run, InputNotes* notes);

/// What is worth a line and is no warning: images of several cameras that do not show the board, a few soft boards.
std::string RemarksOn(const CornerInput& corners);

}  // namespace mvstudio::stages
