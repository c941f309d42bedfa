#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "calib/corners/corner_files.h"
#include "calib/formats/formats_internal.h"

/// Shared by the readers of corner_files.h; included by their .cc files only.
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

/// "640x480"; throws UsageError that begins with `what`.
std::pair<int, int> ParseSize(const std::string& text, const std::string& what);

CornerFile ReadVnl(const std::string& path, const CornerFileOptions& options);
CornerFile ReadCaliscope(const std::string& path, const CornerFileOptions& options);
CornerFile ReadOpenCvCorners(const std::string& path, const CornerFileOptions& options);
CornerFile ReadCornerCsv(const std::string& path, const CornerFileOptions& options);

}  // namespace mvstudio::calib::internal
