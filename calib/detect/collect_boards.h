// Private: for detect_footage.cc.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/detect/detect_footage.h"

/// What was found in all images of a camera, made one layout and one limit of sharpness.
namespace mvstudio::calib {

/// A searched image: what DetectBoards gave.
struct Searched {
  int64_t frame_idx = 0;
  std::vector<std::vector<BoardDetection>> boards;
};

/// Everything known of one camera's footage, from the cache or from the search.
struct CameraResults {
  CameraInput camera;
  std::vector<Searched> images;
  std::optional<std::string> digest;
  bool cached = false;
  std::string failure;
  int64_t num_read = 0;
  double read_s = 0, search_s = 0;
};

/// Empty for a frame that belongs to no time step.
std::optional<int64_t> StepOf(const Footage& footage, int64_t frame_idx);

/// The layout of board `b` that most corners in all footage agree with.
size_t CommonLayout(const std::vector<CameraResults>& results, size_t b, size_t num_layouts);

/// Board `b` of one camera in the layout that was chosen.
struct BoardOfCamera {
  const CameraResults& results;
  const Footage& footage;
  size_t b = 0, layout = 0;
  std::string prefix;  ///< of reasons: names the board where there are several
};

/// Adds what was found. A camera that loses more boards at kSharpMisfit than it keeps takes those of kSoftMisfit, with
/// the weight that their smoothness deserves beside its sharp ones; where it does not, the lost ones are counted. Either is
/// said in `found->soft`.
void Collect(const BoardOfCamera& board, int camera_idx, FootageDetections* found);

/// Leaves the time steps without a detection.
void DropUsed(FootageDetections* found);

std::string LayoutNote(const Board& board, const Board& layout);

}  // namespace mvstudio::calib
