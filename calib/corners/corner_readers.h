// Private: the formats of ReadCornerFile, one reader each.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "calib/corners/corner_files.h"
#include "core/notice.h"

namespace mvstudio::calib::internal {

/// "640x480"; throws UsageError that begins with `what`.
std::pair<int, int> ParseSize(const std::string& text, const std::string& what);

/// Holds the board that was given against the places (corner -> metres on the board) that the file states. Throws FormatError
/// where its corners are numbered or spaced otherwise; a note CAL-BOARD-SIZE where all distances are others.
void CompareBoard(const std::map<int, Eigen::Vector3d>& stated, const Board& given, const std::string& path,
                  std::vector<Notice>* notes);

CornerFile ReadVnl(const std::string& path, const CornerFileOptions& options);
CornerFile ReadCaliscope(const std::string& path, const CornerFileOptions& options);
CornerFile ReadOpenCvCorners(const std::string& path, const CornerFileOptions& options);
/// What OpenCV's calibration sample writes beside the lens: `image_points`, a row of corners for each view of one camera.
CornerFile ReadOpenCvSample(const std::string& path, const CornerFileOptions& options);
CornerFile ReadCornerCsv(const std::string& path, const CornerFileOptions& options);

}  // namespace mvstudio::calib::internal
