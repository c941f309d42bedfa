#include "dataset/footage/frames.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <vector>

#include "core/check.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "core/log.h"
#include "dataset/footage/chapters.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

bool HasImageExtension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const char* known : {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp", ".pgm", ".ppm", ".pnm"}) {
    if (extension == known) return true;
  }
  return false;
}

ImageHeader Unrotated(ImageHeader header) {
  header.turn = ImageTurn();
  return header;
}

Notice TurnNote(const ImageTurn& turn) {
  return {"SES-ROTATED", "the file asks for " + ToText(turn) + "; it is applied",
          "the calibration must be of footage turned the same way"};
}

std::vector<Notice> NotesOn(const ImageHeader& header, bool stretched = false) {
  std::vector<Notice> notes;
  if (header.turn.any()) notes.push_back(TurnNote(header.turn));
  if (header.channels == 2 || (header.channels == 4 && header.codec != "jpeg"))
    notes.push_back(
        {"SES-ALPHA", "its images have opacity, which is left out; colours under it show", "give opacity as masks"});
  if (header.bits > 8 && !stretched) {
    notes.push_back({"SES-DEPTH", "of the " + std::to_string(header.bits) + " bits of its images the upper 8 are used",
                     "stretch images that fill a part of the range before"});
  }
  return notes;
}

std::vector<Notice> NotesOn(const VideoInfo& info) {
  std::vector<Notice> notes;
  if (info.turn.any()) notes.push_back(TurnNote(info.turn));
  if (std::abs(info.pixel_aspect - 1) > 1e-3) {
    notes.push_back({"SES-ASPECT",
                     "its pixels are " + Format("%.4g", info.pixel_aspect) +
                         " times as wide as high; the images are used as stored, not stretched",
                     "calibrate with footage of the same kind; networks that find people see them squeezed"});
  }
  if (info.interlaced) {
    notes.push_back({"SES-INTERLACED", "it is interlaced: the odd rows of a frame are of another moment than the even ones",
                     "deinterlace it (ffmpeg -vf bwdif) before calibration and poses"});
  }
  return notes;
}

void LogNotes(const std::string& path, const std::vector<Notice>& notes) {
  for (const Notice& note : notes) Log(LogLevel::kWarning, path + ": " + note.text);
}

/// Splits a name at its runs of digits so that `image2` comes before `image10`.
bool NaturalLess(const std::string& a, const std::string& b) {
  const auto is_digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!is_digit(a[i]) || !is_digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    const size_t i_end = std::find_if_not(a.begin() + i, a.end(), is_digit) - a.begin();
    const size_t j_end = std::find_if_not(b.begin() + j, b.end(), is_digit) - b.begin();
    const size_t i_first = std::min(a.find_first_not_of('0', i), i_end), j_first = std::min(b.find_first_not_of('0', j), j_end);
    const std::string m = a.substr(i_first, i_end - i_first), n = b.substr(j_first, j_end - j_first);
    if (m.size() != n.size()) return m.size() < n.size();
    if (m != n) return m < n;
    i = i_end, j = j_end;
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

/// Means over blocks of a grey image.
Image Reduced(const Image& grey, int max_side) {
  const int block = std::max((std::max(grey.width, grey.height) + max_side - 1) / max_side, 1);
  Image out(std::max(grey.width / block, 1), std::max(grey.height / block, 1), 1);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      int sum = 0, count = 0;
      for (int v = y * block; v < std::min((y + 1) * block, grey.height); ++v) {
        for (int u = x * block; u < std::min((x + 1) * block, grey.width); ++u) sum += *grey.Pixel(u, v), ++count;
      }
      *out.Pixel(x, y) = static_cast<uint8_t>((sum + count / 2) / count);
    }
  }
  return out;
}

class ImageFolderSource : public FrameSource {
 public:
  ImageFolderSource(std::string path, FootageFiles files, const FrameOptions& options)
      : path_(std::move(path)), files_(std::move(files.paths)), numbers_(std::move(files.images.numbers)), options_(options) {
    if (files.images.by_other_place && !options.quiet)
      Log(LogLevel::kWarning,
          path_ + ": the last number in the names is the same in all or several; an earlier one is the frame");
    as_stored_ = options.sensor_if_rotated_unlike && RotatedUnlike();
    if (as_stored_ && !options.quiet)
      Log(LogLevel::kWarning, path_ + ": EXIF turns these images unlike; they are used as the sensor stored them");
  }

  std::optional<Frame> Advance() override {
    for (; next_ < files_.size(); ++next_) {
      Frame frame;
      frame.frame_idx = static_cast<int64_t>(next_);
      frame.label = fs::path(files_[next_]).filename().string();
      frame.number = numbers_[next_];
      if (!Look(frame.label)) continue;
      ++next_;
      return frame;
    }
    return std::nullopt;
  }

  Image FullImage() override {
    MVS_CHECK(next_ > 0, path_ << ": no frame was read");
    return image_.empty() ? Read(next_ - 1) : std::move(image_);
  }
  Image Thumbnail(int max_side) override { return Reduced(ReadImage(files_[next_ - 1], true, as_stored_), max_side); }
  std::pair<int, int> size_px() const override { return size_px_; }
  int64_t num_frames() const override { return static_cast<int64_t>(files_.size()); }
  const std::string& path() const override { return path_; }
  std::vector<std::string> Damage() const override { return damage_; }

 private:
  Image Read(size_t file) {
    if (!options_.stretch) return ReadImage(files_[file], false, as_stored_);
    StretchedImage image = ReadImageStretched(files_[file], as_stored_);
    if (image.levels > 0 && !told_levels_ && !options_.quiet) {
      Log(LogLevel::kWarning, path_ + ": its images fill about " + std::to_string(image.levels) + " of " +
                                  std::to_string(image.of_levels) + " levels; each is stretched over its own range");
      told_levels_ = true;
    }
    return std::move(image.rgb);
  }

  /// Whether the next file is to be returned. To know that it is sound it must be decoded.
  bool Look(const std::string& label) {
    try {
      image_ = Image();
      if (options_.keep_undamaged) image_ = Read(next_);
      CheckHeader(ReadImageHeader(files_[next_]));
      return true;
    } catch (const FormatError& error) {
      if (!options_.keep_undamaged) throw;
      damage_.push_back(label + ": " + error.what());
      return false;
    }
  }

  bool RotatedUnlike() const {
    std::optional<ImageTurn> first;
    for (const std::string& file : files_) {
      try {
        const ImageTurn turn = ReadImageHeader(file).turn;
        if (!(turn == first.value_or(turn))) return true;
        first = turn;
      } catch (const Error&) {  // reading it says why
      }
    }
    return false;
  }

  /// One camera's images have one frame of pixels.
  void CheckHeader(const ImageHeader& header) {
    if (!turn_ && !options_.quiet) LogNotes(path_, NotesOn(as_stored_ ? Unrotated(header) : header, options_.stretch));
    const ImageTurn first = turn_.value_or(header.turn);
    if (!as_stored_ && !(header.turn == first)) {
      throw FormatError(files_[next_], "EXIF",
                        "asks for " + (header.turn.any() ? ToText(header.turn) : "no turn") + ", the images before it for " +
                            (first.any() ? ToText(first) : "none") +
                            "; a camera's images must be turned alike: write them anew as they are to be shown");
    }
    turn_ = header.turn;
    const bool swap = as_stored_ && header.turn.swaps_sides();
    size_px_ = {static_cast<int>(swap ? header.height : header.width), static_cast<int>(swap ? header.width : header.height)};
  }

  std::string path_;
  std::vector<std::string> files_;
  std::vector<int64_t> numbers_;  ///< of the files
  FrameOptions options_;
  std::vector<std::string> damage_;
  std::optional<ImageTurn> turn_;  ///< of the last image
  bool as_stored_ = false, told_levels_ = false;
  Image image_;
  std::pair<int, int> size_px_{0, 0};
  size_t next_ = 0;
};

std::string RangeText(const std::pair<int64_t, int64_t>& range) {
  return range.first == range.second ? std::to_string(range.first)
                                     : std::to_string(range.first) + " to " + std::to_string(range.second);
}

/// A video in one file, or in several that go on from each other.
class VideoSource : public FrameSource {
 public:
  VideoSource(const std::string& path, std::vector<std::string> files, const FrameOptions& options)
      : path_(path), files_(std::move(files)), options_{options.keep_undamaged, 0} {
    Open(0);
    const VideoInfo& first = reader_->info();
    if (!options.quiet) LogNotes(path_, NotesOn(first));
    num_frames_ = first.num_frames;
    for (size_t i = 1; i < files_.size(); ++i) {
      const VideoInfo info = VideoReader(files_[i]).info();
      num_frames_ = num_frames_ > 0 && info.num_frames > 0 ? num_frames_ + info.num_frames : 0;
      if (info.width == first.width && info.height == first.height) continue;
      throw FormatError(files_[i], "", "its images have another size than those of " + files_[0] + ", which it continues");
    }
  }

  std::optional<Frame> Advance() override {
    while (!reader_->Advance()) {
      AddDamage();
      if (at_ + 1 == files_.size()) return std::nullopt;
      const auto& missing = reader_->damage().missing;
      first_of_file_ += std::max(last_, missing.empty() ? -1 : missing.back().second) + 1;
      clock_.NextFile();
      Open(at_ + 1);
    }
    last_ = reader_->frame_idx();
    Frame frame;
    frame.frame_idx = frame.number = first_of_file_ + last_;
    frame.label = "frame " + std::to_string(frame.frame_idx);
    frame.time_s = clock_.Place(reader_->time_s());
    return frame;
  }
  Image FullImage() override { return reader_->FullImage(); }
  Image Thumbnail(int max_side) override { return reader_->Thumbnail(max_side); }
  std::pair<int, int> size_px() const override { return {reader_->info().width, reader_->info().height}; }
  int64_t num_frames() const override { return num_frames_; }
  const std::string& path() const override { return path_; }
  std::vector<std::string> Damage() const override { return damage_; }

 private:
  void Open(size_t file) {
    at_ = file;
    last_ = -1;
    reader_ = std::make_unique<VideoReader>(files_[file], options_);
  }
  /// Of the file that was read to its end.
  void AddDamage() {
    if (at_ < num_told_) return;
    num_told_ = at_ + 1;
    const VideoDamage& damage = reader_->damage();
    for (const auto& [first, last] : damage.missing)
      damage_.push_back("frames " + RangeText({first_of_file_ + first, first_of_file_ + last}) + " are missing");
    const std::string file = files_.size() > 1 ? fs::path(files_[at_]).filename().string() + ": " : "";
    for (const std::string& cause : damage.causes) damage_.push_back(file + cause);
  }

  std::string path_;
  std::vector<std::string> files_, damage_;
  VideoOptions options_;
  std::unique_ptr<VideoReader> reader_;
  internal::ChapterClock clock_;
  size_t at_ = 0, num_told_ = 0;
  int64_t num_frames_ = 0, first_of_file_ = 0, last_ = -1;
};

std::vector<std::string> OnlyImages(std::vector<std::string> files) {
  files.erase(std::remove_if(files.begin(), files.end(), [](const std::string& f) { return !HasImageExtension(f); }),
              files.end());
  return files;
}

std::vector<std::string> InOrder(const std::string& pattern, std::vector<std::string> videos) {
  return videos.size() > 1 ? InChapterOrder(pattern, std::move(videos)) : videos;
}

void FindGaps(const std::vector<int64_t>& numbers, FootageInfo* info) {
  std::map<int64_t, int> count;
  for (const int64_t number : numbers) ++count[number];
  int64_t last = count.begin()->first - 1;
  for (const auto& [number, times] : count) {
    if (number > last + 1) info->gaps.emplace_back(last + 1, number - 1);
    if (times > 1) info->twice.push_back(number);
    last = number;
  }
}

void DescribeImageFiles(const std::vector<int64_t>& numbers, FootageInfo* info) {
  const ImageHeader header = ReadImageHeader(info->files[0]);
  info->width = static_cast<int>(header.width), info->height = static_cast<int>(header.height);
  info->codec = header.codec;
  info->bits = header.bits;
  info->turn = header.turn;
  info->notes = NotesOn(header);
  info->num_frames = static_cast<int64_t>(info->files.size());
  FindGaps(numbers, info);
}

}  // namespace

void RefuseOrder(const std::string& path, const std::string& label, int64_t number, int64_t last) {
  std::string lower = label;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  bool other = false;
  for (const char* word : {"mask", "seg", "matte", "alpha", "depth", "normal"}) other |= lower.find(word) != std::string::npos;
  throw FormatError(
      path, label,
      "its number " + std::to_string(number) + " does not come after the one before, " + std::to_string(last) +
          (other ? "; it looks like no image of the camera: masks and the like belong in a folder of their own, or give "
                   "a pattern in quotes that the images alone fit"
                 : std::string("; a camera's images have one number each: are two cameras or kinds of images in one folder? ") +
                       kNumberHint));
}

FootageFiles ListFootage(const std::string& path_or_pattern) {
  const std::string& path = path_or_pattern;
  FootageFiles files;
  const bool is_folder = fs::is_directory(path), is_pattern = IsPattern(path);
  if (!is_folder && fs::exists(path)) {
    files.is_video = !HasImageExtension(path), files.paths = {path};
    if (!files.is_video) files.images = NumberFrames(path, files.paths);
    return files;
  }
  if (is_folder || is_pattern) files.paths = FilesMatching(path);
  if (files.paths.empty() && !is_folder) {
    throw IoError(path, is_pattern ? "no file matches the pattern" : "no such file or folder");
  }
  const bool is_one = files.paths.size() == 1 && !HasImageExtension(files.paths[0]);
  if (!is_folder && (is_one || ChapterOf(files.paths[0]))) return {true, InOrder(path, std::move(files.paths)), {}};
  files.paths = OnlyImages(std::move(files.paths));
  if (files.paths.empty() && is_folder)
    throw IoError(path, "the folder holds no .png, .jpg, .tiff, .webp, .bmp, .pgm or .ppm image");
  if (files.paths.empty())
    throw FormatError(path, "", "the pattern matches no .png, .jpg, .tiff, .webp, .bmp, .pgm or .ppm image");
  std::sort(files.paths.begin(), files.paths.end(), NaturalLess);
  files.images = NumberFrames(path, files.paths);
  return files;
}

std::unique_ptr<FrameSource> OpenFrames(const std::string& path_or_pattern, const FrameOptions& options) {
  FootageFiles files = ListFootage(path_or_pattern);
  if (files.is_video) return std::make_unique<VideoSource>(path_or_pattern, std::move(files.paths), options);
  return std::make_unique<ImageFolderSource>(path_or_pattern, std::move(files), options);
}

FootageInfo DescribeFootage(const std::string& path_or_pattern) {
  FootageFiles files = ListFootage(path_or_pattern);
  FootageInfo info;
  info.is_video = files.is_video;
  info.files = std::move(files.paths);
  if (!info.is_video) {
    DescribeImageFiles(files.images.numbers, &info);
    return info;
  }
  const VideoInfo video = VideoReader(info.files[0]).info();
  info.num_frames = info.files.size() > 1 ? OpenFrames(path_or_pattern)->num_frames() : video.num_frames;
  info.width = video.width, info.height = video.height;
  info.fps_hz = video.frame_rate_hz;
  info.codec = video.codec;
  info.bits = video.bits;
  info.turn = video.turn;
  info.notes = NotesOn(video);
  info.time_code_s = video.time_code_s;
  return info;
}

}  // namespace mvstudio::dataset
