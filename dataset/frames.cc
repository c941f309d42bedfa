#include "dataset/frames.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <vector>

#include "core/error.h"
#include "core/files.h"
#include "dataset/image_io.h"
#include "dataset/video_io.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

bool HasImageExtension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
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

class ImageFolderSource : public FrameSource {
 public:
  ImageFolderSource(std::string path, std::vector<std::string> files) : path_(std::move(path)), files_(std::move(files)) {
    std::sort(files_.begin(), files_.end(), NaturalLess);
  }
  std::optional<Frame> Next() override {
    if (next_ == files_.size()) return std::nullopt;
    const std::string& file = files_[next_];
    Frame frame{static_cast<int64_t>(next_), fs::path(file).filename().string(), ReadImage(file)};
    ++next_;
    return frame;
  }
  int64_t num_frames() const override { return static_cast<int64_t>(files_.size()); }
  const std::string& path() const override { return path_; }

 private:
  std::string path_;
  std::vector<std::string> files_;
  size_t next_ = 0;
};

class VideoSource : public FrameSource {
 public:
  explicit VideoSource(const std::string& path) : path_(path), reader_(path) {}
  std::optional<Frame> Next() override {
    std::optional<Image> image = reader_.Next();
    if (!image) return std::nullopt;
    const int64_t idx = reader_.frame_idx();
    return Frame{idx, "frame " + std::to_string(idx), std::move(*image)};
  }
  int64_t num_frames() const override { return reader_.info().num_frames; }
  const std::string& path() const override { return path_; }

 private:
  std::string path_;
  VideoReader reader_;
};

std::vector<std::string> OnlyImages(std::vector<std::string> files) {
  files.erase(std::remove_if(files.begin(), files.end(), [](const std::string& f) { return !HasImageExtension(f); }),
              files.end());
  return files;
}

}  // namespace

std::unique_ptr<FrameSource> OpenFrames(const std::string& path_or_pattern) {
  const std::string& path = path_or_pattern;
  if (fs::is_directory(path)) {
    auto files = OnlyImages(Glob(path));
    if (files.empty()) throw IoError(path, "the folder holds no .png or .jpg picture");
    return std::make_unique<ImageFolderSource>(path, std::move(files));
  }
  if (fs::exists(path)) {
    if (HasImageExtension(path)) return std::make_unique<ImageFolderSource>(path, std::vector<std::string>{path});
    return std::make_unique<VideoSource>(path);
  }
  const bool is_pattern = path.find_first_of("*?") != std::string::npos;
  auto files = is_pattern ? Glob(path) : std::vector<std::string>{};
  if (files.empty()) throw IoError(path, is_pattern ? "no file matches the pattern" : "no such file or folder");
  if (files.size() == 1 && !HasImageExtension(files[0])) return std::make_unique<VideoSource>(files[0]);
  auto images = OnlyImages(files);
  if (images.empty()) throw FormatError(path, "", "the pattern matches no .png or .jpg picture");
  return std::make_unique<ImageFolderSource>(path, std::move(images));
}

}  // namespace mvstudio::dataset
