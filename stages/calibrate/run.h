#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "calib/keypoints/place_marks.h"
#include "calib/pipeline/solvable.h"
#include "calib/points/from_scene.h"
#include "calib/points/scene_points.h"
#include "calib/points/stated_length.h"
#include "core/progress.h"
#include "stages/budget/report.h"
#include "stages/calib/board_views.h"
#include "stages/calib/earlier_world.h"
#include "stages/calib/film_gain.h"
#include "stages/calibrate/options.h"
#include "stages/input_notes.h"

namespace mvstudio::stages {

/// From boards, or from marked points that say what the lenses are, as the corners of one board do.
struct BoardCalibration {
  CornerInput corners;        ///< boards with a back are two (calib/board/sides.h)
  std::vector<int> front_of;  ///< per board: the one whose back it is; -1: none
  std::optional<EarlierWorld> earlier_world;
  calib::SolvableCalibration solved;  ///< left_out: cameras without footage of the board, too
  WrittenBoardViews views;
  std::vector<FilmGain> film_gain;
  std::vector<double> behind_sigmas_mm;  ///< BehindSigmasMm
  std::string poses_path;                ///< of board_poses.csv; empty: not written
  double wall_s = 0;                     ///< from the reading of corners on
};

/// From marks without places, and lengths between them.
struct MarkedCalibration {
  calib::MarkedRig placed;                  ///< as large as the lengths say
  std::optional<calib::LengthScale> scale;  ///< nothing where the marks place no cameras
};

struct CalibrateReport {
  CalibrateOptions options;  ///< as the session settled them
  InputNotes notes;
  std::vector<std::string> library_lenses;  ///< cameras whose lens the library has
  std::variant<BoardCalibration, MarkedCalibration, calib::SceneResectionReport, calib::FromSceneReport> found;
  std::string path;  ///< of calibration.json; empty: nothing was solved, and it is not written
  std::optional<BudgetReport> budget;
};

/// Why a camera is left out that the take with the board does not show.
inline constexpr char kNotFilmed[] = "the take with the board has no footage of it";

/// Calibrates cameras, and writes calibration.json with what else the options ask for. Throws UsageError, IoError and
/// FormatError; what cannot be solved is no error (the status in CalibrateReport::found).
CalibrateReport RunCalibrate(CalibrateOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
