#include <algorithm>
#include <cmath>

#include "calib/board/board.h"
#include "calib/verdict/judgement.h"
#include "core/format.h"

/// Lengths on the boards, and what they hang on: the lenses, and cells that may not be square.
namespace mvstudio::calib::internal {
namespace {

// Of triangulated corners against the images they come from, median; and of lengths over the size of the board.
constexpr double kWarnTriangulatedPx = 1, kFailTriangulatedPx = 5;
constexpr double kWarnLengths = 0.005, kFailLengths = 0.02;
constexpr double kWarnStray = 0.02, kFailStray = 0.10;  // of the triangulated corners

const char* const kNoiseHint =
    "the cameras agree with each other, so this is the corners' noise in depth, or a board that is not as described: cameras "
    "farther apart, nearer boards, sharper images, a measured board";

/// No camera's corners are farther off in the rig than by themselves: time and motion are not the cause.
bool CamerasAgree(const CalibrateReport& report) {
  constexpr double kAgrees = 1.1, kSlackPx = 0.02;
  return report.frames_conflict.empty() &&
         std::all_of(report.cameras.begin(), report.cameras.end(), [&](const CameraReport& camera) {
           return camera.rms_px <= kAgrees * camera.alone_rms_px + kSlackPx && camera.num_lost_views == 0;
         });
}

/// The cells of a board are not as high as wide, by more than printers and paper make of squares.
bool CellsNotSquare(const geometry::RigBoard& board) { return std::abs(board.stretch.y()) > 0.005; }

std::string CellsText(const geometry::RigBoard& shape) {
  const double ratio = (1 - shape.stretch.y()) / (1 + shape.stretch.y());
  return Format("the cells of board %s are not squares, they are %.1f %% %s than wide", shape.board.c_str(),
                100 * std::abs(ratio - 1), ratio > 1 ? "higher" : "less high");
}

/// The images give the ratio of height to width alone, so one of the two must be as stated.
std::string CellsHint(const geometry::RigBoard& shape) {
  if (shape.board.rfind("points:", 0) == 0) return "measure them";
  const Board board = ParseBoard(shape.board);
  const double ratio = (1 - shape.stretch.y()) / (1 + shape.stretch.y());
  const double width_mm = 1e3 * board.square_m, height_mm = 1e3 * board.row_step();
  const std::string as_wide = Format("%.4gx%.4gmm", width_mm, height_mm * ratio);
  const std::string as_high = Format("%.4gx%.4gmm", width_mm / ratio, height_mm);
  std::string hint = "measure them: " + as_wide + " if they are as wide as stated, " + as_high +
                     " if they are as high; until then all lengths of the rig may be off by " +
                     Format("%.1f %%", 100 * std::abs(std::sqrt(ratio) - 1));
  const size_t cell = shape.board.find(':', shape.board.find(':') + 1);
  const bool takes_two =
      board.kind == Board::Kind::kChessboard || board.kind == Board::Kind::kGrid || board.kind == Board::Kind::kCircles;
  if (takes_two) hint += "; option 'board' " + shape.board.substr(0, cell + 1) + as_wide;
  return hint;
}

/// A camera whose lens the boards leave open: what follows from lenses is no news until they are known.
std::string LensStillOpen(const CalibrateReport& report) {
  constexpr double kOpenFocal = 0.1;
  for (const CameraReport& camera : report.cameras) {
    if (camera.lens_held) continue;
    if (camera.assumes || camera.focal_sigma_px > kOpenFocal * camera.focal_px || !std::isfinite(camera.holdout_rms_px))
      return camera.name;
  }
  return "";
}

/// Pixels that are not square and cells that are not look alike on boards that are never rotated.
bool AspectIsOpen(const CalibrateReport& report, size_t c) {
  constexpr double kSigmas = 4, kSquareAspect = 0.005;
  const CameraReport& camera = report.cameras[c];
  if (!(camera.aspect_sigma > 0) || c >= report.rig.cameras.size()) return false;
  const geometry::Camera& lens = report.rig.cameras[c].camera;
  double aspect = std::abs(std::log(lens.fx() / lens.fy()));
  for (const geometry::RigBoard& board : report.rig.boards) aspect = std::max(aspect, 2 * std::abs(board.stretch.y()));
  // Cells that were never tried leave everything to the pixels.
  const bool untried = report.board_stretch.empty() && report.stretch_untried;
  return untried ? aspect > kSquareAspect : aspect < kSigmas * camera.aspect_sigma;
}

bool AnyAspectOpen(const CalibrateReport& report) {
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    if (AspectIsOpen(report, c)) return true;
  }
  return false;
}

}  // namespace

void JudgeAspect(const CalibrateReport& report, Judgement* out) {
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    if (!AspectIsOpen(report, c)) continue;
    const CameraReport& camera = report.cameras[c];
    const geometry::Camera& lens = report.rig.cameras[c].camera;
    const std::string known = std::isfinite(camera.aspect_sigma) ? Format(" (to %.2g %%)", 100 * camera.aspect_sigma) : "";
    out->Warn("CAL-ASPECT",
              Format("camera %s: whether its pixels are not square (fx / fy %.4g) or the cells of the board are not is "
                     "undetermined%s",
                     camera.name.c_str(), lens.fx() / lens.fy(), known.c_str()),
              "measure the board's cells along both sides, or film the board rotated by a quarter turn in half of the images");
  }
}

void JudgeLengths(const CalibrateReport& report, double scale, Judgement* out) {
  const BoardMetrics& boards = report.board_metrics;
  out->Limit(boards.reprojection_median_px, kWarnTriangulatedPx * scale, kFailTriangulatedPx * scale, "CAL-TRIANGULATED",
             Format("triangulated corners lie %.2f px (median) from the images they come from", boards.reprojection_median_px),
             kTimeHint);
  if (boards.num_points > 0) {
    const double stray = static_cast<double>(boards.num_stray_points) / boards.num_points;
    out->Limit(stray, kWarnStray, kFailStray, "CAL-STRAY",
               Format("%d of %d triangulated corners lie far from where the others of their board put them",
                      boards.num_stray_points, boards.num_points),
               "some corners are detected wrongly, or numbered otherwise in one camera: look at the rejected ones");
  }
  const double share = 1e-3 * boards.pair_rms_mm / report.board_size_m;
  const std::string text = Format("lengths on the triangulated boards are off by %.3g mm, %.1f %% of the board's size",
                                  boards.pair_rms_mm, 100 * share);
  if (const std::string open = LensStillOpen(report); !open.empty())
    return out->Limit(share, kWarnLengths, kFailLengths, "CAL-LENGTHS", text,
                      "the lens of camera " + open + " is not known yet, and lengths follow from it: first mend that");
  const auto cells = AnyAspectOpen(report) ? report.rig.boards.end()
                                           : std::find_if(report.rig.boards.begin(), report.rig.boards.end(), CellsNotSquare);
  if (cells == report.rig.boards.end())
    return out->Limit(share, kWarnLengths, kFailLengths, "CAL-LENGTHS", text, CamerasAgree(report) ? kNoiseHint : kTimeHint);
  const std::string told = (std::isfinite(share) ? text + ": " : "") + CellsText(*cells);
  share > kFailLengths ? out->Fail("CAL-LENGTHS", told, CellsHint(*cells)) : out->Warn("CAL-LENGTHS", told, CellsHint(*cells));
}

}  // namespace mvstudio::calib::internal
