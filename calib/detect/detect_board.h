#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/detection.h"
#include "calib/detect/corner_refine.h"
#include "core/image.h"
#include "core/status.h"

namespace mvstudio::calib {

struct DetectOptions {
  std::string detector =
      "fast";               ///< "fast", or "exact": OpenCV's exhaustive sector-based search for chessboards, 15 times slower
  int min_corners = 8;      ///< boards with fewer good corners are dropped; a single tag needs its 4
  double max_misfit = 0.2;  ///< rms grey-value misfit of a corner over its contrast
  bool check_mirror = true;  ///< look for markers in the mirrored image when none is found, to say so
};

template <class Visitor>
void VisitFields(Visitor&& visit, DetectOptions& o) {
  visit("detector", o.detector, "fast, or exact: slower search for chessboards that are hard to see");
  visit("min-corners", o.min_corners, "boards with fewer good corners are dropped; a single tag needs its 4");
  visit("max-misfit", o.max_misfit, "grey-value misfit of a corner over its contrast above which it is dropped");
}

struct BoardDetection {
  Status status = Status::kOk;  ///< kTooFewViews: no board found; kDegenerate: what was found is not the board; kOutlier: too
                                ///< few good corners
  std::string reason;           ///< one phrase when the status is not kOk
  Detection detection;          ///< camera_idx, frame_idx and board_idx are left to the caller
  int num_found = 0;            ///< corners before the check of every single one
  double sigma_px = 0;          ///< robust distance from the smooth image of a plane, per coordinate
  int num_markers = 0;          ///< markers or tags in their places on the board; 0 for a chessboard
  bool legacy = false, inverted = false;  ///< the ChArUco layout that fits, see LayoutsOf
};

/// Finds the board in a grey or RGB image. Every corner is located by RefineCorner and checked against the smooth image of a
/// plane (PlaneToImage). A chessboard is found as a whole; the others may be partly hidden. The numbering of a chessboard
/// is unique only when one of its two numbers of corners is odd and the other even (see HasUniqueNumbering). For a ChArUco board
/// that leaves its layout open (see LayoutsOf) the one that fits better is taken; AprilGrids are read with either width of
/// border. An image seen in a mirror is refused with that reason, but a mirrored chessboard looks like any other.
BoardDetection DetectBoard(const Board& board, const Image& image, const DetectOptions& options = {});

/// The boards that `board` may stand for. A ChArUco board: itself, with the legacy layout when that differs, and both with black
/// and white exchanged, but for what the board asks for anyway; other boards: themselves. Corner ids and positions are the same
/// in all.
std::vector<Board> LayoutsOf(const Board& board);

/// DetectBoard for several boards and each of their layouts: result[b][l] belongs to LayoutsOf(boards[b])[l]. Markers are
/// searched once for all boards of one dictionary or family; exchanged colours only when no layout fits without.
std::vector<std::vector<BoardDetection>> DetectBoards(const std::vector<Board>& boards, const Image& image,
                                                      const DetectOptions& options = {});

/// Which of a board's layouts fits better; the first one when both do alike.
size_t BetterLayout(const std::vector<BoardDetection>& layouts);

/// Locates the guessed corners in a grey image and checks them: what DetectBoard does after its search.
BoardDetection LocateBoard(const Board& board, const Image& grey, const std::vector<CornerGuess>& guesses,
                           const DetectOptions& options = {});

/// R, G, B to brightness; a grey image is returned as it is.
Image ToGrey(const Image& image);

/// False for a chessboard that looks the same after half a turn.
bool HasUniqueNumbering(const Board& board);

}  // namespace mvstudio::calib
