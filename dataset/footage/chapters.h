#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dataset/footage/video_io.h"

/// Recordings that a camera wrote as several files, one after the other: GoPro's chapters. Frames are numbered through all
/// of them.
namespace mvstudio::dataset {

/// The recording that a file belongs to and its place in it, by GoPro's names: GX010123.MP4, GX020123.MP4, … (GH, GS
/// alike), and GOPR0123.MP4, GP010123.MP4, … of older cameras.
/// https://community.gopro.com/s/article/GoPro-Camera-File-Naming-Convention
struct Chapter {
  std::string recording;  ///< "GX0123", "GOPR0123"
  int number = 0;         ///< from 1
};
/// Empty for any other name.
std::optional<Chapter> ChapterOf(const std::string& path);

/// A pattern beside the file that the chapters of its recording match: "raw/GX??0123.MP4". The path itself when it is no
/// chapter.
std::string ChapterPattern(const std::string& path);

/// The files in the order of their numbers. Throws FormatError with `pattern` when they are not all of one recording, or when
/// one is missing between the first and the last.
std::vector<std::string> InChapterOrder(const std::string& pattern, std::vector<std::string> files);

/// Names of the chapters before the last of these files, all of one recording, that are not among them.
std::vector<std::string> MissingChapters(const std::vector<std::string>& files);

/// Presentation times of a video in one or several files. A file goes on a frame period after the one before.
VideoTimes ReadVideoTimes(const std::vector<std::string>& files);

namespace internal {

/// Time at which the next file of a recording starts: one mean frame period after the last frame of this one.
class ChapterClock {
 public:
  /// A frame of the current file, seconds by its own time stamps; the time since the recording's first file began.
  double Place(double time_s);
  /// The frames placed from here on are the next file's.
  void NextFile();

 private:
  double first_s_ = 0, last_s_ = 0, shift_s_ = 0, next_s_ = 0;
  int64_t count_ = 0;
  bool follows_ = false;
};

}  // namespace internal
}  // namespace mvstudio::dataset
