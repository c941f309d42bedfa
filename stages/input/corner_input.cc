#include "stages/input/corner_input.h"

#include <algorithm>

#include "calib/board/layout.h"
#include "calib/check/same_corners.h"
#include "core/error.h"
#include "core/join.h"
#include "core/some_of.h"
#include "dataset/session/timeline_source.h"
#include "stages/input/board_footage.h"
#include "stages/input/board_pairing.h"

namespace mvstudio::stages {
namespace {

void RequireCamera(const std::string& name, bool known) {
  if (!known) throw UsageError("option 'mirrored' " + name + ": there is no camera called '" + name + "'");
}

void MarkMirrored(const std::vector<std::string>& mirrored, std::vector<calib::Footage>* footage) {
  for (const std::string& name : mirrored) {
    bool known = false;
    for (calib::Footage& camera : *footage) {
      if (camera.camera == name) camera.mirrored = known = true;
    }
    RequireCamera(name, known);
  }
}

/// Corners of a file: column u becomes width - 1 - u.
void FlipCorners(const std::vector<std::string>& mirrored, calib::CalibrateInput* input) {
  for (const std::string& name : mirrored) {
    const auto camera =
        std::find_if(input->cameras.begin(), input->cameras.end(), [&](const auto& c) { return c.name == name; });
    RequireCamera(name, camera != input->cameras.end());
    if (camera->width_px <= 0)
      throw UsageError("option 'mirrored' " + name + ": its image size is not known; give option 'size'");
    for (calib::Detection& detection : input->detections) {
      if (detection.camera_idx != camera - input->cameras.begin()) continue;
      detection.points_px.row(0) = (camera->width_px - 1.0) - detection.points_px.row(0).array();
      const calib::Board& board = input->boards[static_cast<size_t>(detection.board_idx)];
      for (int& id : detection.corner_ids)  // what ran mirrored was taken for the back
        id = (id + (board.back_m ? board.num_side_corners() : 0)) % board.num_corners();
    }
  }
}

/// What the mirrored cameras' calibration is for.
void WarnMirrored(const std::vector<std::string>& mirrored, InputNotes* notes) {
  if (mirrored.empty()) return;
  notes->warnings.push_back({"CAL-MIRRORED", "calibrated as images that are not flipped: " + Join(mirrored, ", "),
                             "flip their footage left-right before other commands read it"});
}

/// Two boards with a mark in common cannot be told apart.
void RequireDistinct(const std::vector<calib::Board>& boards) {
  for (size_t a = 0; a < boards.size(); ++a) {
    for (size_t b = a + 1; b < boards.size(); ++b) {
      const std::string shared = calib::SharedMarks(boards[a], boards[b]);
      if (shared.empty()) continue;
      throw UsageError("the boards " + calib::ToString(boards[a]) + " and " + calib::ToString(boards[b]) + " share " + shared +
                       ": print them with other ids (first=ID) or another dictionary; a back that shows the front in a "
                       "mirror is one board with two-sided=THICKNESS");
    }
  }
}

/// Whether nothing of a board was found, which may as well be out of sight.
bool ShowsNothing(const std::string& reason) { return reason.rfind("no ", 0) == 0; }

/// "camera a: 16 of 30 images are not used (reason: 4, 5, …)" of those images that `counts` takes; empty where they are a tenth
/// at most.
template <class Counts>
std::string UnusedImages(const calib::FootageDetections& camera, const Counts& counts) {
  constexpr size_t kMostNamed = 8;
  size_t count = 0;
  std::vector<std::string> parts;
  for (const auto& [reason, steps] : camera.unused) {
    if (steps.empty() || !counts(reason)) continue;
    count += steps.size();
    std::vector<std::string> names;
    for (const int64_t step : steps) names.push_back(std::to_string(step));
    parts.push_back(reason + ": " + SomeOf(names, kMostNamed));
  }
  if (10 * count <= static_cast<size_t>(camera.num_images)) return "";
  return "camera " + camera.camera.name + ": " + std::to_string(count) + " of " + std::to_string(camera.num_images) +
         " images are not used (" + Join(parts, "; ") + ")";
}

/// Images that should show a board and do not, where they are more than a tenth. One of several cameras need not see it.
void WarnUnused(const calib::FootageDetections& camera, bool alone, InputNotes* notes) {
  if (!camera.failure.empty()) return;
  const std::string doubtful = UnusedImages(camera, [&](const std::string& reason) { return alone || !ShowsNothing(reason); });
  if (!doubtful.empty())
    notes->warnings.push_back({"CAL-UNUSED", doubtful, "look at some of them: the board whole, sharp and large enough"});
}

std::string SoftText(const calib::FootageDetections& camera, const calib::SoftBoards& soft) {
  return "camera " + camera.camera.name + ": " + soft.text;
}

/// The timeline of a table of times, in place of what a session says.
dataset::Timeline TimelineOfTable(const CornerArguments& arguments, InputNotes* notes) {
  if (arguments.cameras.empty())
    throw UsageError("option 'timestamps' pairs footage: it needs option 'camera' or option 'session'");
  constexpr double kImageRateHz = 30;  // the table's times replace it
  std::vector<dataset::SessionCamera> cameras;
  std::vector<dataset::CameraTimes> times;
  for (const NamedPath& camera : arguments.cameras) {
    cameras.push_back({camera.name, "", "", 0, 0});
    times.push_back(dataset::ReadFootageTimes(camera.name, camera.path, kImageRateHz));
  }
  for (const std::string& note : dataset::ReadTimestamps(arguments.timestamps, cameras, &times))
    notes->warnings.push_back({"SES-TIMELINE", note, "see docs/formats.md for the columns of time stamps"});
  notes->inputs.push_back(arguments.timestamps);
  return dataset::BuildTimeline(times, dataset::TimelineClock::kCommon, nullptr);
}

/// Boards whose corners can be numbered in several ways, where views have to agree on one.
void WarnAmbiguous(const std::vector<calib::Board>& boards, size_t num_cameras, InputNotes* notes) {
  for (const calib::Board& board : boards) {
    const int turns = calib::NumLikeTurns(board);
    if (turns == 1 || num_cameras * boards.size() < 2) continue;
    notes->warnings.push_back(
        {"CAL-AMBIGUOUS",
         "the board " + calib::ToString(board) + " looks the same after " + (turns == 4 ? "a quarter turn" : "half a turn"),
         "use a chessboard with one odd and one even number of corners, or ChArUco"});
  }
}

/// What the search says of a camera's images.
void WarnOfSearch(const calib::FootageDetections& camera, bool alone, InputNotes* notes) {
  WarnUnused(camera, alone, notes);
  for (const calib::SoftBoards& soft : camera.soft) {
    if (soft.many)
      notes->warnings.push_back({"CAL-SOFT", SoftText(camera, soft), "focus, light and a still board make corners sharp"});
  }
  for (const std::string& note : camera.notes) {
    notes->warnings.push_back({"CAL-BOARD", "camera " + camera.camera.name + ": " + note, ""});
  }
}

/// Refuses those of `options` (name, whether it was given) that have no effect on this source of corners.
void RefuseUseless(const std::vector<std::pair<const char*, bool>>& options, const std::string& why) {
  std::vector<std::string> given;
  for (const auto& [name, is_given] : options) {
    if (is_given) given.push_back("option '" + std::string(name) + "'");
  }
  if (!given.empty()) throw UsageError(Join(given, ", ") + " has no effect here: " + why + "; leave it out");
}

void RefuseSearchOptions(const calib::FootageOptions& search) {
  const calib::FootageOptions standard;
  RefuseUseless({{"every", search.every != standard.every},
                 {"max-frames", search.max_frames != standard.max_frames},
                 {"detector", search.detect.detector != standard.detect.detector},
                 {"min-corners", search.detect.min_corners != standard.detect.min_corners},
                 {"max-misfit", search.detect.max_misfit != standard.detect.max_misfit}},
                "nothing is searched, all corners of the file are taken");
}

void RefuseFileOptions(const calib::CornerFileOptions& file) {
  RefuseUseless({{"corners-format", file.format != calib::CornerFormat::kAuto},
                 {"corners-unit", file.unit != calib::LengthUnit::kMetre},
                 {"corners-camera", !file.cameras.empty()},
                 {"size", !file.sizes.empty()}},
                "it is of a file of corners (option 'corners'), and footage says it itself");
}

/// Two cameras with one file would stand in one place, which nothing else contradicts.
void RequireOwnFootage(const calib::CalibrateInput& input) {
  if (const auto same = calib::FindSameCorners(input)) throw UsageError(ToString(*same));
}

CornerInput DetectCorners(const CornerArguments& arguments, const dataset::Timeline* timeline, const RunContext& run,
                          InputNotes* notes) {
  RefuseFileOptions(arguments.corner_files);
  if (arguments.boards.empty()) throw UsageError("option 'board' is needed: what to look for in the footage");
  RequireDistinct(arguments.boards);
  std::vector<calib::Footage> footage = OpenFootage(arguments.cameras, notes);
  if (timeline) PairByTime(*timeline, &footage, notes);
  MarkMirrored(arguments.mirrored, &footage);
  WarnAmbiguous(arguments.boards, footage.size(), notes);
  CornerInput corners;
  corners.found = calib::DetectFootage(arguments.boards, footage, arguments.footage, run);
  for (const calib::FootageDetections& camera : corners.found) WarnOfSearch(camera, corners.found.size() == 1, notes);
  corners.input = calib::ToCalibrateInput(arguments.boards, corners.found);
  RequireOwnFootage(corners.input);
  return corners;
}

CornerInput ReadCorners(const CornerArguments& arguments, InputNotes* notes) {
  if (!arguments.cameras.empty())
    throw UsageError("give either option 'camera' (footage) or option 'corners' (a file), not both");
  if (arguments.boards.size() > 1) throw UsageError("option 'corners' takes one option 'board' at most");
  RefuseSearchOptions(arguments.footage);
  calib::CornerFileOptions options = arguments.corner_files;
  if (!arguments.boards.empty()) options.board = arguments.boards[0];
  const calib::CornerFile file = calib::ReadCornerFile(arguments.corners, options);
  if (const auto fault = calib::FindLayoutFault(file.boards, file.detections))
    throw FormatError(arguments.corners, "", calib::ToString(*fault));
  notes->inputs.push_back(arguments.corners);
  Append(file.notes, &notes->warnings);
  CornerInput corners;
  corners.input.boards = file.boards;
  corners.input.cameras = file.cameras;
  corners.input.detections = file.detections;
  RequireOwnFootage(corners.input);
  FlipCorners(arguments.mirrored, &corners.input);
  return corners;
}

}  // namespace

std::vector<std::string> CornerPaths(const CornerArguments& arguments) {
  std::vector<std::string> paths;
  for (const NamedPath& camera : arguments.cameras) paths.push_back(camera.path);
  if (!arguments.corners.empty()) paths.push_back(arguments.corners);
  return paths;
}

std::string RemarksOn(const CornerInput& corners) {
  std::string text;
  for (const calib::FootageDetections& camera : corners.found) {
    const bool unused = corners.found.size() > 1 && camera.failure.empty();
    const std::string unseen = unused ? UnusedImages(camera, ShowsNothing) : "";
    if (!unseen.empty()) text += unseen + "\n";
    for (const calib::SoftBoards& soft : camera.soft) {
      if (!soft.many) text += SoftText(camera, soft) + "\n";
    }
  }
  return text;
}

void FillTimeline(CornerArguments* arguments, InputNotes* notes) {
  if (arguments->timestamps.empty()) return;
  arguments->timeline = std::make_shared<const dataset::Timeline>(TimelineOfTable(*arguments, notes));
}

CornerInput ReadCornerInput(const CornerArguments& arguments, const RunContext& run, InputNotes* notes) {
  std::shared_ptr<const dataset::Timeline> timeline = arguments.timeline;
  if (!arguments.timestamps.empty() && !timeline)
    timeline = std::make_shared<const dataset::Timeline>(TimelineOfTable(arguments, notes));
  WarnMirrored(arguments.mirrored, notes);
  return arguments.corners.empty() ? DetectCorners(arguments, timeline.get(), run, notes) : ReadCorners(arguments, notes);
}

}  // namespace mvstudio::stages
