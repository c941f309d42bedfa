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

/// A board in one image, as far as it matters for what is still to be filmed.
struct FilmedBoard {
  int camera_idx = 0;
  int64_t frame_idx = 0;
  Eigen::Matrix2Xd px;                             // (2, N) corners that were kept
  std::optional<geometry::Rigid3> cam_from_board;  // where it is known
  double range_m = 0;                              ///< distance from the camera; 0: unknown
};

/// A sentence that says what is missing and what to do about it.
struct FilmHint {
  std::string code;     ///< FILM-LINK, FILM-FEW, FILM-COVERAGE, FILM-TILT or FILM-RANGE
  int camera_idx = -1;  ///< FILM-LINK: one of the two
  std::string text;
};

/// Corners with a weight at a solution; `range_m` is that of their mean.
std::vector<FilmedBoard> FilmedBoards(const std::vector<View>& views, const RigState& state);
/// The same from a result; `range_m` is that of the board's origin. Lenses alone: without poses where frames repeat.
std::vector<FilmedBoard> FilmedBoards(const CalibrateReport& report);

/// What to film so that the next calibration is better, the most useful first; empty when nothing is missing:
///   FILM-LINK      the cameras' strongest links (maximum spanning tree of frames with a board in both) that have fewer than 5
///   FILM-FEW       cameras with fewer than 8 boards
///   FILM-COVERAGE  parts of an image (3 x 3: corners, sides, middle) of whose cells (10 x 8 over the image) less than a third
///                  holds a corner
///   FILM-TILT      cameras with fewer than a tenth of their boards (and fewer than 2) tilted by 15 degrees or more about the
///                  image's vertical or horizontal axis
///   FILM-RANGE     cameras whose farthest board is less than 1.3 times as far as the nearest
/// Without `as_rig` the cameras count one by one, and no links are missed.
std::vector<FilmHint> FilmNext(const std::vector<geometry::Camera>& cameras, const std::vector<FilmedBoard>& boards,
                               bool as_rig = true);
/// Of a result: as a rig unless its cameras have no common frame (lenses alone).
std::vector<FilmHint> FilmNext(const CalibrateReport& report);

}  // namespace mvstudio::calib
