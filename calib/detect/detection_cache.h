#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/detect/detect_board.h"

namespace mvstudio::calib {

/// Detections in the footage of one camera, for one board, before its layout is chosen.
struct StoredFootage {
  struct Picture {
    int64_t frame_idx = 0;
    std::vector<BoardDetection> layouts;  ///< as returned by DetectBoards
  };
  int width_px = 0, height_px = 0;
  std::vector<Picture> pictures;
};

/// Where detection results are kept: "auto", "off", or a folder.
struct CachePlace {
  enum class Kind {
    kAuto,  ///< the environment variable MVSTUDIO_CACHE (off or a folder) if it is set, else $XDG_CACHE_HOME/mvstudio or
            ///< ~/.cache/mvstudio
    kOff,
    kFolder,
  };
  Kind kind = Kind::kAuto;
  std::string folder;  ///< of kFolder
};
CachePlace CacheIn(const std::string& folder);
/// As an option, see core/fields.h.
std::string ToString(const CachePlace& place);
void FromString(const std::string& text, CachePlace* place);

/// Detection results on disk, one file per footage and board, named by a digest of everything that determines them.
/// Damaged files and those of another version count as missing. Several processes may use one folder.
class DetectionCache {
 public:
  explicit DetectionCache(const CachePlace& place);

  bool enabled() const { return !folder_.empty(); }
  const std::string& folder() const { return folder_; }

  std::optional<StoredFootage> Load(const std::string& key) const;
  /// Never throws: on a full or read-only disk it only logs a warning.
  void Store(const std::string& key, const StoredFootage& footage) const;

 private:
  std::string PathOf(const std::string& key) const { return folder_ + "/" + key + ".detections"; }
  std::string folder_;
};

/// Digest of the names and contents of the files that a path or pattern stands for; empty when there are none.
std::optional<std::string> ContentDigest(const std::string& path_or_pattern);

/// Key of the results for one board in footage with this digest, when frames that are multiples of `stride` are searched.
std::string DetectionKey(const std::string& content_digest, const Board& board, const DetectOptions& options, int stride);

}  // namespace mvstudio::calib
