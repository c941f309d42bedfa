#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/detect/detect_board.h"

namespace mvstudio::calib {

/// What was found in the footage of one camera, for one board, before the choice between its layouts.
struct StoredFootage {
  struct Picture {
    int64_t frame_idx = 0;
    std::vector<BoardDetection> layouts;  ///< as DetectBoards gives them
  };
  int width_px = 0, height_px = 0;
  std::vector<Picture> pictures;
};

/// Results of the detectors on the disk, one file a footage and board, named by a digest of everything that determines them.
/// Files that are damaged or of another version count as missing. Several processes may use one folder.
class DetectionCache {
 public:
  /// `where`: "off", a folder, or "auto": the environment variable MVSTUDIO_CACHE (off or a folder) when it is set, else
  /// $XDG_CACHE_HOME/mvstudio or ~/.cache/mvstudio.
  explicit DetectionCache(const std::string& where);

  bool enabled() const { return !folder_.empty(); }
  const std::string& folder() const { return folder_; }

  std::optional<StoredFootage> Load(const std::string& key) const;
  /// Never throws: a full or read-only disk costs a warning in the log, not the result.
  void Store(const std::string& key, const StoredFootage& footage) const;

 private:
  std::string PathOf(const std::string& key) const { return folder_ + "/" + key + ".detections"; }
  std::string folder_;
};

/// Digest of the names and contents of the files that a path or pattern stands for; nothing when there are none.
std::optional<std::string> ContentDigest(const std::string& path_or_pattern);

/// Key of the results for one board in footage with this digest, of which frames that are multiples of `stride` are searched.
std::string DetectionKey(const std::string& content_digest, const Board& board, const DetectOptions& options, int stride);

}  // namespace mvstudio::calib
