// Private: for the readers of corner files.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "calib/board/detection.h"

namespace mvstudio::calib::internal {

/// Collects single corners into detections.
class DetectionBuilder {
 public:
  explicit DetectionBuilder(std::string path) : path_(std::move(path)) {}

  /// Index of a camera; new names are appended in order of appearance. Throws FormatError for a name that is not UTF-8.
  int Camera(const std::string& name);
  const std::vector<std::string>& cameras() const { return cameras_; }
  /// Throws FormatError when this corner was already given for this camera, frame and board, or a value is out of range.
  void Add(int camera_idx, int64_t frame_idx, int board_idx, int corner, const Eigen::Vector2d& px, double sigma_px,
           const std::string& where);
  std::vector<Detection> Finish() const;

 private:
  struct Corner {
    Eigen::Vector2d px;
    double sigma_px;
  };
  std::string path_;
  std::vector<std::string> cameras_;
  std::map<std::string, int> camera_idx_;
  std::map<std::tuple<int, int64_t, int>, std::map<int, Corner>> views_;
};

}  // namespace mvstudio::calib::internal
