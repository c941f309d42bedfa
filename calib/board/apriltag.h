#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/image.h"

namespace mvstudio::calib {

/// One of the tag families of the AprilTag library, or one of OpenCV's dictionaries of ArUco markers (Krogius, Haggenmiller,
/// Olson, "Flexible layouts for fiducial tags", IROS 2019). Cells are the squares of one bit.
struct TagFamily {
  std::string name;           ///< without "tag": 36h11, 25h9, 16h5, Circle21h7, Circle49h12, Custom48h12, Standard41h12, …
  int num_tags = 0;           ///< ids are 0 to num_tags - 1
  int border_cells = 0;       ///< cells along the side of the square whose corners are found
  int total_cells = 0;        ///< cells along the side of the whole print
  bool white_inside = false;  ///< the found square is white inside and black outside (newer families), else the reverse
  bool aruco = false;         ///< a dictionary of ArUco markers: name 4x4_50, …, aruco_original
};

/// The family that `name` means in any case and with or without `tag` before it, or the dictionary of ArUco markers; `name`
/// itself for none.
std::string CanonicalTagFamily(const std::string& name);
std::optional<TagFamily> FindTagFamily(const std::string& name);
/// Those of the AprilTag library.
const std::vector<std::string>& AllTagFamilies();
/// All names, separated by ", ".
std::string TagFamilyNames();

/// The print of a tag. Row by row from the top left of the upright tag, 1 for black.
struct TagPattern {
  int border_cells = 0, total_cells = 0;
  std::vector<uint8_t> black;  // (total_cells, total_cells)
};

/// `border` is the width of the black border in cells, 1 or (classic families only) 2 as in Kalibr's prints.
TagPattern PatternOf(const TagFamily& family, int id, int border = 1);

/// A tag found in an image.
struct Tag {
  int id = 0;
  int border = 1;                  ///< width of the black border in cells with which the tag decoded
  int hamming = 0;                 ///< bits corrected
  double decision_margin = 0;      ///< mean grey-value distance of the bits from the threshold
  Eigen::Matrix<double, 2, 4> px;  ///< bottom left, bottom right, top right, top left of the upright tag
};

enum class TagBorder { kNarrow, kWide, kEither };  ///< black borders of 1 cell, of 2 cells (Kalibr), or both in one search

/// Detects all tags of a family in a grey image, sorted by id; a tag may appear several times. The corners are the
/// library's, converted to this project's pixel origin. They are 0.02 to 0.2 px off even without noise (see RefineCorner).
/// Families with a white inside have no wide border.
std::vector<Tag> FindTags(const TagFamily& family, TagBorder border, const Image& grey);

}  // namespace mvstudio::calib
