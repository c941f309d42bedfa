#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <tuple>

#include "core/image.h"
#include "dataset/footage/frames.h"

/// Single frames of footage, in any order, read when they are asked for.
namespace mvstudio::stages {

class FrameStore {
 public:
  /// `root`: links followed, files outside of it are not read; empty: all are. `most_bytes` of images are kept as JPEG.
  FrameStore(std::string root, size_t most_bytes) : root_(std::move(root)), most_bytes_(most_bytes) {}

  /// The frame with this number; empty where there is none. Of a video the frames between the last one and a later one are
  /// decoded; an earlier one begins anew. Throws IoError, FormatError, and UsageError for a file outside of the root.
  Image Read(const std::string& footage, int64_t number);
  /// As JPEG, reduced to a longer side of at most `longer_side_px`; 0: as it is. Empty where there is none.
  const std::string& Jpeg(const std::string& footage, int64_t number, int longer_side_px);

  size_t bytes() const { return bytes_; }

 private:
  struct Opened {
    dataset::FootageFiles files;
    std::map<int64_t, std::string> images;         ///< of images: number -> path
    std::unique_ptr<dataset::FrameSource> source;  ///< of a video, while it is read forwards
    int64_t at = -1;                               ///< its frame
  };
  Opened& Open(const std::string& footage);
  Image ReadVideo(const std::string& footage, int64_t number, Opened* opened);
  void MakeRoom();

  using Key = std::tuple<std::string, int64_t, int>;
  struct Kept {
    std::string jpeg;
    std::list<Key>::iterator place;
  };
  std::string root_;
  size_t most_bytes_, bytes_ = 0;
  std::map<std::string, Opened> opened_;
  std::map<Key, Kept> kept_;
  std::list<Key> order_;  ///< the last used first
};

}  // namespace mvstudio::stages
