#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/observations.h"
#include "calib/detect/detect_board.h"
#include "calib/detect/detection_cache.h"
#include "core/choice/option_group.h"
#include "core/image.h"
#include "core/progress.h"

namespace mvstudio::calib {

struct FootageFrame {
  int64_t frame_idx = 0;  ///< equal numbers are the same time step in all cameras, but for Footage::step_of_frame
  std::string label;      ///< for messages: file name or "frame 12"
  Image image;
};

/// The footage of one camera. `next` returns frames in order and an empty value at the end; it is called from one thread
/// at a time. When `path` stands for files, their contents and names must determine the frames, because results are cached
/// by them.
struct Footage {
  std::string camera, path;
  int64_t num_frames = 0;  ///< 0 when unknown
  bool mirrored = false;   ///< the images are flipped left-right; they are searched as if they were not, and so are the corners
  std::function<std::optional<FootageFrame>()> next;
  /// Time step of each frame number, where these differ between cameras; frames without one are not used. Empty: the
  /// numbers are the time steps. Detections then carry time steps, and `every` and `max_frames` choose among those.
  std::map<int64_t, int64_t> step_of_frame;
};

struct FootageOptions {
  int every = 1;       ///< only frames whose number is a multiple of this are searched
  int max_frames = 0;  ///< maximum number of frames searched per camera, thinned out further; 0: all
  CachePlace cache;    ///< of earlier results
  DetectOptions detect;
  bool all_cameras = true;  ///< a camera that never sees a board, or has unusable images, is an error; else its
                            ///< FootageDetections::failure says so while others see one
};

template <class Visitor>
void VisitFields(Visitor&& visit, FootageOptions& o) {
  StartGroup(visit, "Search for boards");
  visit("every", o.every, "search only frames whose number is a multiple of this");
  visit("max-frames", o.max_frames, "maximum number of frames to search per camera, evenly spread; 0: all");
  visit("cache", o.cache,
        "where boards found before are kept: a folder, off, or auto: $MVSTUDIO_CACHE, $XDG_CACHE_HOME/mvstudio or "
        "~/.cache/mvstudio");
  VisitFields(visit, o.detect);
}

/// Boards that keep few of their corners at kSharpMisfit.
struct SoftBoards {
  std::string text;    ///< one line: how many, and what was done
  bool taken = false;  ///< they are most of the camera's boards, and were taken at kSoftMisfit
  bool many = false;   ///< more than a tenth of the camera's boards
};

/// Detections in one camera's footage.
struct FootageDetections {
  CameraInput camera;
  std::vector<Detection> detections;   ///< camera_idx is the position of the footage
  int num_images = 0;                  ///< searched
  int num_corners_dropped = 0;         ///< located, but rejected against the smooth image of a plane
  std::map<std::string, int> reasons;  ///< why boards were not used -> number of images; names the board when there are
                                       ///< several
  std::map<std::string, std::vector<int64_t>> unused;  ///< reason -> time steps whose image shows no board, in order; the first
                                                       ///< board's reason
  std::vector<std::string> notes;                      ///< one line each: a layout that was determined, a board never seen
  std::vector<SoftBoards> soft;                        ///< at most one a board
  std::string failure;              ///< why there are no detections (FootageOptions::all_cameras); empty: there are some
  bool cached = false;              ///< read from the cache without a search
  int64_t num_read = 0;             ///< frames that were read, searched or not; 0 where `cached`
  double read_s = 0, search_s = 0;  ///< seconds of all threads together
};

/// Detects the boards in all footage, images in parallel; the result does not depend on the number of threads. An
/// ambiguous layout of a ChArUco board (see LayoutsOf) is decided for all footage together. Throws FormatError when the
/// images of a camera differ in size, when two have the same number, or when a camera never sees a board; without
/// `all_cameras`, when that holds for every camera.
std::vector<FootageDetections> DetectFootage(const std::vector<Board>& boards, std::vector<Footage>& footage,
                                             const FootageOptions& options, const RunContext& run);
std::vector<FootageDetections> DetectFootage(const Board& board, std::vector<Footage>& footage, const FootageOptions& options,
                                             const RunContext& run);

/// All detections as input of Calibrate.
CalibrateInput ToCalibrateInput(const std::vector<Board>& boards, const std::vector<FootageDetections>& found);

}  // namespace mvstudio::calib
