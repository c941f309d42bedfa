#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/image.h"
#include "core/notice.h"
#include "dataset/footage/frame_numbers.h"
#include "dataset/footage/image_turn.h"

namespace mvstudio::dataset {

/// The frames of one camera, in order: from a video file, an image folder, a pattern of images (`left*.jpg`), or one of the
/// files of a recording (`GX??0123.MP4`, see chapters.h).
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  struct Frame {
    int64_t frame_idx = 0;  ///< videos and folders: position from 0
    std::string label;      ///< file name of an image, "frame 12" for a video: for messages
    Image rgb;
    int64_t number = 0;            ///< videos: position; images: see NumberFrames
    std::optional<double> time_s;  ///< videos: presentation time
  };
  std::optional<Frame> Next() {
    std::optional<Frame> frame = Advance();
    if (frame) frame->rgb = FullImage();
    return frame;
  }
  /// Next in two steps, when not every image is needed: `rgb` stays empty until FullImage is called.
  virtual std::optional<Frame> Advance() = 0;
  virtual Image FullImage() = 0;
  /// Grey, reduced so that the longer side is `max_side`; sufficient to detect motion.
  virtual Image Thumbnail(int max_side) = 0;
  /// Size of the frame that Advance returned.
  virtual std::pair<int, int> size_px() const = 0;
  virtual int64_t num_frames() const = 0;  ///< 0 when unknown
  virtual const std::string& path() const = 0;
  /// What is missing from footage read to its end with keep_undamaged, one line each.
  virtual std::vector<std::string> Damage() const { return {}; }
};

struct FrameOptions {
  bool keep_undamaged = false;  ///< skip damaged frames and images instead of throwing; Damage() lists them
  /// Images that are not all turned alike (EXIF) come as the sensor stored them, instead of a FormatError: a lens belongs to
  /// the sensor, however the camera was held.
  bool sensor_if_rotated_unlike = false;
  /// Images of more than 8 bits that fill a small part of their range are stretched over it, each by itself, see
  /// StretchedTo8Bits: for what looks for edges, not for what measures brightness.
  bool stretch = false;
  bool quiet = false;  ///< nothing goes to the log: the footage was read before
};

/// Throws IoError when nothing matches, FormatError when a file is neither an image nor a video. What the first image says
/// and is not simply read (Notice) goes to the log.
std::unique_ptr<FrameSource> OpenFrames(const std::string& path_or_pattern, const FrameOptions& options = {});

/// The files of the footage: the images in order, or a video in one file or several chapters.
struct FootageFiles {
  bool is_video = false;
  std::vector<std::string> paths;
  FrameNumbers images;  ///< of images: the number of each
};
/// Throws like OpenFrames.
FootageFiles ListFootage(const std::string& path_or_pattern);

/// What to do about images of one camera that do not have a number each.
inline constexpr char kNumberHint[] =
    "a pattern in quotes takes some images, and its `*` stands for the frame: 'both/*_0.jpg' takes 7 of both/7_0.jpg";

/// Throws FormatError for the image `label` of footage at `path`, whose number is not above `last`, that of the one before.
[[noreturn]] void RefuseOrder(const std::string& path, const std::string& label, int64_t number, int64_t last);

/// Properties of footage, determined without reading all of it.
struct FootageInfo {
  bool is_video = false;
  int width = 0, height = 0;  ///< as displayed; of the first image
  double fps_hz = 0;          ///< 0: images, or unknown
  int64_t num_frames = 0;     ///< 0: unknown
  std::string codec;          ///< "h264", "png"
  int bits = 8;
  ImageTurn turn;                                 ///< that the file asks for; it is applied
  std::vector<Notice> notes;                      ///< turn, opacity, 16 bits, pixels that are not square, interlacing
  std::optional<double> time_code_s;              ///< as in VideoInfo, of the first file
  std::vector<std::string> files;                 ///< images in order; the files of the video
  std::vector<std::pair<int64_t, int64_t>> gaps;  ///< numbers that no image has, as ranges (first, last)
  std::vector<int64_t> twice;                     ///< numbers that several images have
};
/// Throws like OpenFrames.
FootageInfo DescribeFootage(const std::string& path_or_pattern);

}  // namespace mvstudio::dataset
