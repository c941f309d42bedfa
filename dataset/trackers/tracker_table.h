// Private: for the readers of this folder.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/pose/deeplabcut_table.h"
#include "dataset/trackers/tracker_file.h"

namespace mvstudio::dataset::internal {

/// coord is "x", "y" or "likelihood"; others are ignored.
using TrackerColumn = DeepLabCutColumn;

/// Whether it is x, y or likelihood. Others need not be numbers.
bool IsCoordinate(const TrackerColumn& column);

/// Turns rows of numbers into the people of a camera's frames.
class TrackerTable {
 public:
  /// Throws FormatError for a point without x or y, with z, or given twice, and when there is no point at all.
  TrackerTable(const std::string& path, const std::string& camera, const std::string& program,
               const std::vector<TrackerColumn>& columns);

  /// `row` has a number per column, NaN: none. Throws FormatError (`place` of the row) for a frame that came before, unless
  /// `more`: then its people are more of that frame.
  void Add(int frame, const std::vector<double>& row, const std::string& place, bool more = false);
  /// Throws FormatError when there is no frame.
  TrackedPoints Finish();

 private:
  struct Point {
    size_t individual = 0, joint = 0;
    int x = -1, y = -1, score = -1;  // columns
  };
  void AddColumn(const TrackerColumn& column, int index, std::map<std::pair<std::string, std::string>, size_t>* known);
  [[noreturn]] void Fail(const std::string& place, const std::string& what) const;
  void CountPlaces(size_t people, const std::string& place);

  std::string path_;
  TrackedPoints points_;
  std::vector<Point> table_;
  size_t num_columns_, num_cells_ = 0, num_places_ = 0;
};

/// x, y and score as a keypoint: not detected where a coordinate is not finite; a score that is no number is 1.
Keypoint2d ToKeypoint(double x_px, double y_px, double score);

}  // namespace mvstudio::dataset::internal
