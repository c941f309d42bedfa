#include "python/read_fields.h"
#include "python/stage.h"
#include "stages/align/describe.h"
#include "stages/board/describe.h"
#include "stages/calib_files/describe.h"
#include "stages/calibrate/describe.h"
#include "stages/compare/describe.h"
#include "stages/eval/describe.h"
#include "stages/refine/describe.h"

namespace mvstudio::python {
namespace {

using Given = std::set<std::string>;

constexpr char kInputsHelp[] = "calibration file or folder (opencv, mrcal, easymocap: several)";

void AddFileStages(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::CalibConvertOptions>(
      {"calib_convert",
       "calib convert",
       "Read a calibration of any known program and write it for another.",
       {"inputs", "out"}},
      [](auto& visit, auto& o) {
        visit("inputs", o.in, kInputsHelp);
        VisitFields(visit, o);
        VisitRead(visit, o.read);
      },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunCalibConvert(o)); }));
  all->push_back(MakeStage<stages::CalibShowOptions>(
      {"calib_show", "calib show", "Print a calibration as a table.", {"inputs"}},
      [](auto& visit, auto& o) {
        visit("inputs", o.in, kInputsHelp);
        VisitRead(visit, o.read);
      },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunCalibShow(o)); }));
  all->push_back(MakeStage<stages::CalibResizeOptions>(
      {"calib_resize", "calib resize", "Lenses for images of another resolution, or for a crop.", {"calibration", "out"}},
      [](auto& visit, auto& o) {
        visit("calibration", o.calibration, "calibration to change");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunCalibResize(o)); }));
  all->push_back(MakeStage<stages::LensAddOptions>(
      {"calib_lenses_add",
       "calib lenses add",
       "Add the lens of a calibrated camera to a library.",
       {"library", "calibration", "camera", "serial"}},
      [](auto& visit, auto& o) {
        visit("library", o.library, "library: a file, which is made if need be");
        visit("calibration", o.calibration, "calibration with the camera");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunLensAdd(o)); }));
}

struct Library {
  std::string library;
};

void AddLibraryStages(std::vector<Stage>* all) {
  for (const bool check : {false, true}) {
    const std::string word = check ? "check" : "list";
    all->push_back(MakeStage<Library>(
        {"calib_lenses_" + word,
         "calib lenses " + word,
         check ? "Check the lenses of a library: implausible ones, those without covariance."
               : "Print the lenses of a library.",
         {"library"}},
        [](auto& visit, auto& o) { visit("library", o.library, "library: a file"); },
        [check](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunLensList(o.library, check)); }));
  }
}

void AddComparisons(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::CompareOptions>(
      {"calib_compare", "calib compare", "Difference of two calibrations: poses and projection.", {"rig", "reference"}},
      [](auto& visit, auto& o) {
        visit("rig", o.rig, "calibration");
        visit("reference", o.reference, "reference calibration");
        VisitFields(visit, o);
        VisitRead(visit, o.read);
      },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunCompare(o)); }));
  all->push_back(MakeStage<stages::EvalOptions>(
      {"calib_eval", "calib eval", "Check a calibration on new footage of a board: which camera moved, and how far."},
      [](auto& visit, auto& o) {
        visit("calibration", o.calibration, "calibration to check; that of option 'session' unless given");
        VisitFields(visit, o);
        VisitFormat(visit, o.read);
        visit("unit", o.read.unit, "unit of length of files that name none");
        VisitMeaning(visit, o.read);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunEval(o, run)); }));
  all->push_back(MakeStage<stages::AlignOptions>(
      {"calib_align",
       "calib align",
       "Move a calibrated rig to another world: a board on the floor, or known points.",
       {"calibration", "out"}},
      [](auto& visit, auto& o) {
        visit("calibration", o.calibration, "calibration to move");
        VisitFields(visit, o);
        VisitFormat(visit, o.read);
        VisitMeaning(visit, o.read);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunAlign(o, run)); }));
}

struct RefineBoth {
  stages::CalibrateOptions boards;
  stages::RefineOptions keypoints;
};

stages::CommandResult RunEither(RefineBoth both, const RunContext& run) {
  if (!both.keypoints.IsGiven()) {
    if (!both.keypoints.pose.pose2d.empty()) throw UsageError("option 'pose2d' belongs to option 'from-keypoints'");
    return Describe(stages::RunCalibrate(both.boards, run));
  }
  both.keypoints.pose.calib = both.boards.start, both.keypoints.out = both.boards.out;
  return Describe(stages::RunRefine(both.keypoints, run));
}

void AddSolvers(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::CalibrateOptions>(
      {"calibrate", "calibrate", "Calibrate cameras from footage of a board, or from its corners."},
      [](auto& visit, auto& o) { VisitFields(visit, o); },
      [](auto o, const Given& given, const RunContext& run) {
        o.given = given;
        return Describe(stages::RunCalibrate(std::move(o), run));
      }));
  all->push_back(MakeStage<RefineBoth>(
      {"calib_refine",
       "calib refine",
       "Adjust a calibration to footage of a board, or to people, markers or animals.",
       {"calib"}},
      [](auto& visit, auto& o) {
        visit("calib", o.boards.start, "the calibration to refine");
        VisitBoardFields(visit, o.boards);
        VisitFields(visit, o.keypoints);
      },
      [](const auto& o, const Given&, const RunContext& run) { return RunEither(o, run); }));
}

void AddBoards(std::vector<Stage>* all) {
  all->push_back(MakeStage<calib::ProposeOptions>(
      {"board_propose", "board propose", "Boards that fit the paper, and the distances that they suit."},
      [](auto& visit, auto& o) { VisitFields(visit, o); },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunBoardProposals(o)); }));
  all->push_back(MakeStage<stages::BoardDrawing>(
      {"board_draw", "board draw", "Write a board as PDF, SVG or PNG at true scale.", {"board", "out"}},
      [](auto& visit, auto& o) {
        visit("board", o.board, calib::kBoardForms);
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunBoardDraw(o)); }));
  all->push_back(MakeStage<stages::BoardSearch>(
      {"board_check", "board check", "Find out which board is in the images, and how to write it.", {"images"}},
      [](auto& visit, auto& o) {
        visit("images", o.images, "images, folders, patterns, or videos");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunBoardSearch(o, run)); }));
}

}  // namespace

void AddCalibrationStages(std::vector<Stage>* all) {
  AddSolvers(all), AddComparisons(all), AddFileStages(all), AddLibraryStages(all), AddBoards(all);
}

}  // namespace mvstudio::python
