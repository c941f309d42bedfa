#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "core/progress.h"
#include "stages/input/corner_input.h"
#include "stages/result.h"

/// Single images of the board with the corners that were found and their residuals, for the report.
namespace mvstudio::stages {

/// In a calibration's output folder, owned by mvstudio.
inline constexpr char kBoardViewsFolder[] = "board-views";

/// A board in one image of one camera.
struct BoardView {
  int camera_idx = 0;     ///< in the report
  int64_t frame_idx = 0;  ///< as in CalibrateReport::residuals
  int64_t frame = 0;      ///< as in the footage
  bool worst = false;     ///< the largest residuals; else an ordinary view of many corners
  double rms_px = 0;      ///< 2-D, over kept corners
  std::vector<calib::CornerResidual> corners;
};

/// Up to two views of each camera: among those with at least three quarters of the most corners the one of median RMS, and
/// among those with at least half of them the one of the largest. `number` gives a frame's number in the footage, negative
/// for frames that are not to be taken.
std::vector<BoardView> ChooseBoardViews(const calib::CalibrateReport& report,
                                        const std::function<int64_t(int camera, int64_t frame_idx)>& number);

/// Their corners as metrics: [{camera, frame, kind, rms_px, box_px, picture, corners}]. `pictures` are file names, empty ones
/// null. A corner is [x, y, dx, dy, 1 if it was rejected else 0] px, observed minus projected.
nlohmann::ordered_json BoardViewsJson(const calib::CalibrateReport& report, const std::vector<BoardView>& views,
                                      const std::vector<std::string>& images);

struct WrittenBoardViews {
  std::vector<BoardView> views;
  std::vector<std::string> paths;  ///< one a view; empty where its image cannot be read again
};

/// Writes small images of chosen views into the folder kBoardViewsFolder of `out`, in place of an earlier run's. `kept`: the
/// report's cameras as indices of the footage.
WrittenBoardViews WriteBoardViews(const CornerArguments& arguments, const calib::CalibrateReport& report,
                                  const std::vector<int>& kept, const std::string& out, const RunContext& run);

/// "board_views" in the metrics, and the images as outputs.
CommandResult DescribeBoardViews(const calib::CalibrateReport& report, const WrittenBoardViews& written);

}  // namespace mvstudio::stages
