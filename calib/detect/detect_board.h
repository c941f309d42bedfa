#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/detection.h"
#include "calib/detect/corner_refine.h"
#include "core/image.h"
#include "core/status.h"

namespace mvstudio::calib {

enum class Detector {
  kFast,
  kExact,  ///< OpenCV's exhaustive sector-based search for chessboards, 15 times slower
};
/// As an option, see core/fields.h.
std::string_view ToString(Detector detector);
void FromString(const std::string& text, Detector* detector);

constexpr double kSharpMisfit = 0.2;  ///< of the contrast: corners of sharp images lie far below
/// Of soft, noisy or interlaced images, and of markers whose white rim is thinner than the blur.
constexpr double kSoftMisfit = 0.5;

struct DetectOptions {
  Detector detector = Detector::kFast;
  int min_corners = 8;  ///< boards with fewer good corners are dropped; a single tag needs its 4
  /// rms grey-value misfit of a corner over its contrast; 0: kSharpMisfit, and what kSoftMisfit gives besides as
  /// BoardDetection::soft.
  double max_misfit = 0;
  bool check_mirror = true;  ///< if no marker is found, also search the mirrored image, to report a mirrored board
};

template <class Visitor>
void VisitFields(Visitor&& visit, DetectOptions& o) {
  visit("detector", o.detector, "fast, or exact: slower search for chessboards that are hard to see");
  visit("min-corners", o.min_corners, "boards with fewer good corners are dropped; a single tag needs its 4");
  visit("max-misfit", o.max_misfit,
        "grey-value misfit of a corner over its contrast above which it is dropped; 0: 0.2, or 0.5 for a camera that loses "
        "most of "
        "its boards at 0.2");
}

struct BoardDetection {
  Status status = Status::kOk;  ///< kTooFewViews: no board found; kDegenerate: what was found is not the board; kOutlier: too
                                ///< few good corners
  std::string reason;           ///< one phrase when the status is not kOk
  Detection detection;          ///< set by the caller: camera_idx, frame_idx and board_idx
  int num_found = 0;            ///< corners before each is checked
  double sigma_px = 0;          ///< robust distance from the smooth image of a plane, per coordinate
  int num_markers = 0;          ///< markers or tags at their positions on the board; 0 for a chessboard
  bool legacy = false, inverted = false;  ///< the layout that fits, see LayoutsOf
  /// One entry where kSharpMisfit leaves less than half of the corners of a board that kSoftMisfit finds: that board. To be
  /// taken where it goes for most boards of a camera; a single blurred board is better lost.
  std::vector<BoardDetection> soft;

  bool seen() const { return status == Status::kOk || !soft.empty(); }
};

/// Detects the board in a grey or RGB image. Every corner is located by RefineCorner and checked against the smooth image
/// of a plane (PlaneToImage). A chessboard must be visible as a whole; other boards may be partly hidden.
///
/// The numbering of a chessboard is unique only when one of its two numbers of corners is odd and the other even (see
/// NumLikeTurns). For a ChArUco board with an ambiguous layout (see LayoutsOf), the layout that fits better is
/// taken. AprilGrids are read with either border width. A mirrored image is refused with that reason, but a mirrored
/// chessboard cannot be recognised. Of a two-sided board the side in view is found.
BoardDetection DetectBoard(const Board& board, const Image& image, const DetectOptions& options = {});

/// The layouts that `board` may stand for. ChArUco: itself, with the legacy layout when that differs, and both with black
/// and white exchanged; without those that the board already specifies. Chessboards with two odd or two even numbers:
/// themselves, and with black and white exchanged, unless that is a turn of the same print. Other boards: themselves. Corner
/// ids and positions are the same in all.
std::vector<Board> LayoutsOf(const Board& board);

/// DetectBoard for several boards and each of their layouts: result[b][l] belongs to LayoutsOf(boards[b])[l]. Markers are
/// searched once for all boards of one dictionary or family; exchanged colours are tried only when no layout fits
/// otherwise.
std::vector<std::vector<BoardDetection>> DetectBoards(const std::vector<Board>& boards, const Image& image,
                                                      const DetectOptions& options = {});

/// Corners of the board, of its `soft` where there is one.
int NumCornersSeen(const BoardDetection& found);

/// Index of the layout that fits better; the first one when both fit equally.
size_t BetterLayout(const std::vector<BoardDetection>& layouts);

/// Locates the guessed corners in a grey image and checks them: the second part of DetectBoard.
BoardDetection LocateBoard(const Board& board, const Image& grey, const std::vector<CornerGuess>& guesses,
                           const DetectOptions& options = {});

/// BoardDetection::reason of a board that can be read only in a mirror.
inline constexpr char kMirroredReason[] = "the image is mirrored: the markers can be read only in a mirror";

/// The image in a mirror: column u becomes width - 1 - u.
Image FlippedLeftRight(const Image& image);

/// Converts RGB to brightness; a grey image is returned unchanged.
Image ToGrey(const Image& image);

/// Throws UsageError for a board that cannot be searched in images, with the reason.
void RequireSearchable(const Board& board);

}  // namespace mvstudio::calib
