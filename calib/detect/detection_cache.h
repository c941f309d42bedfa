#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/detect/detect_board.h"
#include "core/disk/kept.h"

namespace mvstudio::calib {

/// Detections in the footage of one camera, for one board, before its layout is chosen.
struct StoredFootage {
  struct DetectedImage {
    int64_t frame_idx = 0;
    std::vector<BoardDetection> layouts;  ///< as returned by DetectBoards
  };
  int width_px = 0, height_px = 0;
  std::vector<DetectedImage> images;
};

/// Detection results on disk, one file per footage and board, named by a digest of everything that determines them.
/// Those of another version count as missing.
class DetectionCache {
 public:
  explicit DetectionCache(const CachePlace& place) : kept_(place, "detections") {}

  bool enabled() const { return kept_.enabled(); }
  std::optional<StoredFootage> Load(const std::string& key) const;
  void Store(const std::string& key, const StoredFootage& footage) const;

 private:
  KeptResults kept_;
};

/// Digest of the names and contents of the files that a path or pattern stands for; empty when there are none.
std::optional<std::string> ContentDigest(const std::string& path_or_pattern);

/// Key of the results for one board in footage with this digest, when frames that are multiples of `stride` are searched.
std::string DetectionKey(const std::string& content_digest, const Board& board, const DetectOptions& options, int stride);

}  // namespace mvstudio::calib
