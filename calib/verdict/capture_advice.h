#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/bundle/view.h"
#include "calib/calibrate.h"
#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// A board in one image, with what matters for choosing further footage.
struct FilmedBoard {
  int camera_idx = 0;
  int64_t frame_idx = 0;
  Eigen::Matrix2Xd px;                             // (2, N) corners that were kept
  std::optional<geometry::Rigid3> cam_from_board;  // where it is known
  double range_m = 0;                              ///< distance from the camera; 0: unknown
};

/// A sentence that states what is missing and what to do.
struct FilmHint {
  std::string code;     ///< FILM-LINK, FILM-FEW, FILM-COVERAGE, FILM-TILT or FILM-RANGE
  int camera_idx = -1;  ///< FILM-LINK: one of the two
  std::string text;
  std::string brief;  ///< FILM-COVERAGE: what to do, in half a line
};

/// Boards from the weighted corners at a solution; `range_m` is that of their mean.
std::vector<FilmedBoard> FilmedBoards(const std::vector<View>& views, const RigState& state);
/// Same from a result; `range_m` is that of the board's origin. With lenses alone: no poses where frames repeat.
std::vector<FilmedBoard> FilmedBoards(const CalibrateReport& report);

/// What to film to improve the next calibration, most useful first; empty when nothing is missing:
///   FILM-LINK: the cameras' strongest links (maximum spanning tree of frames with a board in both) with fewer than 5
///     frames.
///   FILM-FEW: cameras with fewer than 8 boards.
///   FILM-COVERAGE: parts of an image (3 x 3: corners, sides, middle) where less than a third of the cells (10 x 8 over
///     the image) hold a corner.
///   FILM-TILT: cameras with fewer than a tenth of their boards (and fewer than 2) tilted by 15 degrees or more about
///     the image's vertical or horizontal axis.
///   FILM-RANGE: cameras whose farthest board is less than 1.3 times as far as the nearest.
///
/// Without `as_rig` the cameras are judged separately and no links are required.
std::vector<FilmHint> CaptureAdvice(const std::vector<geometry::Camera>& cameras, const std::vector<FilmedBoard>& boards,
                                    bool as_rig = true);
/// Of a result: as a rig, unless its cameras have no common frame (lenses alone).
std::vector<FilmHint> CaptureAdvice(const CalibrateReport& report);

}  // namespace mvstudio::calib
