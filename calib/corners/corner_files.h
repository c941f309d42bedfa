#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/detection.h"
#include "calib/board/observations.h"
#include "calib/corners/corner_options.h"
#include "core/notice.h"

/// Board corners found by another program: reads and checks them, and writes them in mvstudio's own format
/// (docs/corner-files.md).
namespace mvstudio::calib {

struct CornerFile {
  std::vector<CameraInput> cameras;   ///< sizes are 0 if neither the file nor the options state them
  std::vector<Board> boards;          ///< indexed by Detection::board_idx
  std::vector<Detection> detections;  ///< by camera, frame, board; corner ids ascending; not empty
  std::vector<Notice> notes;          ///< what a reader assumed, changed or noticed, for the user to check
};

/// Reads corners from one of these formats:
///   vnl: `# filename x y level` of mrcal and mrgingham, the corners of an image row by row. sigma = 2^level (or
///     1/weight); rows with '-' are corners that were not found. Camera and frame come from the image's name.
///   caliscope: xy.csv. sync_index is the time step; the file's own object points make the board. Sizes come from the
///     session's camera_array.toml when it lies in the same folder or up to three above.
///   opencv: XML of OpenCV's omnidirectional samples, objectPoints with imagePoints, or imagePoints1 and imagePoints2.
///   csv: what WriteCornerFile writes.
///
/// Boards whose corners are mirrored in every view are renumbered. A note reports that, and cameras that see only the back
/// of a board. Throws UsageError for options that are missing or contradict the file, IoError, FormatError with the line.
CornerFile ReadCornerFile(const std::string& path, const CornerFileOptions& options = {});

/// Writes corners as CSV `camera,frame,board,corner,x_px,y_px[,sigma_px]` after `#` lines with the cameras' sizes and the
/// boards. Reading the file gives bit-identical values. Throws UsageError when a camera's name cannot be written.
void WriteCornerFile(const CornerFile& file, const std::string& path);

/// -1 when the view of a planar board is mirrored (seen from the back), 1 when not. 0 when undecidable: fewer than 3
/// corners, collinear ones, or a board that is not planar. The sign of the determinant of the best affine map.
int ViewOrientation(const Board& board, const Detection& detection);

/// A grid board when the points (3, N, metres) are a regular grid numbered row by row (to 1e-4 of its step), with any
/// position and orientation; the frame `board` is then the grid's own. Otherwise a board of these points.
Board BoardFromPoints(const Eigen::Matrix3Xd& points);

}  // namespace mvstudio::calib
