#pragma once

#include <string>

#include "calib/board.h"
#include "calib/detection.h"
#include "core/image.h"
#include "core/status.h"

namespace mvstudio::calib {

struct DetectOptions {
  std::string detector =
      "fast";               ///< "fast", or "exact": OpenCV's exhaustive sector-based search for chessboards, 15 times slower
  int min_corners = 8;      ///< boards with fewer good corners are dropped
  double max_misfit = 0.2;  ///< rms grey-value misfit of a corner over its contrast
};

template <class Visitor>
void VisitFields(Visitor&& visit, DetectOptions& o) {
  visit("detector", o.detector, "fast, or exact: slower search for chessboards that are hard to see");
  visit("min-corners", o.min_corners, "boards with fewer good corners are dropped");
  visit("max-misfit", o.max_misfit, "grey-value misfit of a corner over its contrast above which it is dropped");
}

struct BoardDetection {
  Status status = Status::kOk;  ///< kTooFewViews: no board found; kDegenerate: what was found is not the board; kOutlier: too
                                ///< few good corners
  std::string reason;           ///< one phrase when the status is not kOk
  Detection detection;          ///< camera_idx and frame_idx are left to the caller
  int num_found = 0;            ///< corners before the check of every single one
};

/// Finds the board in a grey or RGB image. Every corner is located by RefineCorner and checked against the smooth image of a
/// plane (PlaneToImage). A chessboard is found as a whole; a ChArUco board may be partly hidden. The numbering of a chessboard
/// is unique only when one of its two numbers of corners is odd and the other even (see HasUniqueNumbering).
BoardDetection DetectBoard(const Board& board, const Image& image, const DetectOptions& options = {});

/// False for a chessboard that looks the same after half a turn.
bool HasUniqueNumbering(const Board& board);

}  // namespace mvstudio::calib
