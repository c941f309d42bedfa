#include "stages/input/frame_images.h"

#include <algorithm>
#include <filesystem>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::stages {
namespace {

constexpr int64_t kMostDecoded = 300;  // frames of a video
constexpr int kQualities[] = {80, 65, 50};
constexpr int kSmallestSide = 64;

Image Cropped(const Image& frame, const FrameImage& box) {
  MVS_CHECK(box.x >= 0 && box.y >= 0 && box.width > 0 && box.height > 0 && box.x + box.width <= frame.width &&
                box.y + box.height <= frame.height,
            "a part of " << box.width << "x" << box.height << " at " << box.x << ", " << box.y << " of an image of "
                         << frame.width << "x" << frame.height);
  Image part(box.width, box.height, frame.channels);
  for (int y = 0; y < box.height; ++y)
    std::copy_n(frame.Pixel(box.x, box.y + y), static_cast<size_t>(box.width) * frame.channels, part.Pixel(0, y));
  return part;
}

}  // namespace

FrameImage BoxAround(const std::vector<Eigen::Vector2d>& points_px, const geometry::Camera& camera) {
  Eigen::Array2d low(camera.width_px, camera.height_px), high(0, 0);
  for (const Eigen::Vector2d& p : points_px) {
    if (p.allFinite() && geometry::InImage(camera, p)) low = low.min(p.array()), high = high.max(p.array());
  }
  if ((low > high).any()) return {{}, 0, 0, camera.width_px, camera.height_px};
  const double margin = std::max(20.0, 0.125 * (high - low).maxCoeff());
  const Eigen::Array2i first = (low - margin).floor().cast<int>().max(0);
  const Eigen::Array2i end = (high + margin).ceil().cast<int>().min(Eigen::Array2i(camera.width_px, camera.height_px));
  return {{}, first.x(), first.y(), end.x() - first.x(), end.y() - first.y()};
}

FrameImage SmallImage(const Image& frame, FrameImage box, int longer_side_px, size_t most_bytes) {
  const Image part = Cropped(frame, box);
  for (int side = longer_side_px;; side = side * 3 / 4) {
    const Image reduced = dataset::Reduced(part, side);
    for (const int quality : kQualities) {
      box.jpeg = dataset::EncodeImage(reduced, "picture.jpg", quality);
      if (box.jpeg.size() <= most_bytes || side < kSmallestSide) return box;
    }
  }
}

FrameImage SmallImage(const Image& frame, int longer_side_px, size_t most_bytes) {
  return SmallImage(frame, {{}, 0, 0, frame.width, frame.height}, longer_side_px, most_bytes);
}

int64_t LastCheapFrame(const std::string& footage_path) {
  try {
    if (dataset::ListFootage(footage_path).is_video) return kMostDecoded - 1;
  } catch (const Error&) {  // then no frame can be read, and any number is as good
  }
  return std::numeric_limits<int64_t>::max();
}

std::map<int64_t, Image> ReadFrames(const std::string& footage_path, std::set<int64_t> numbers) {
  std::map<int64_t, Image> images;
  try {
    const auto source = dataset::OpenFrames(footage_path, {false, true, true, true});
    while (!numbers.empty()) {
      const auto frame = source->Advance();
      if (!frame) break;
      if (numbers.erase(frame->number) > 0) images[frame->number] = source->FullImage();
    }
  } catch (const Error&) {  // moved or damaged since: a page without the image
  }
  return images;
}

std::vector<std::string> WriteImages(const std::vector<std::string>& images, const std::vector<std::string>& names,
                                     const std::string& folder) {
  MVS_CHECK(images.size() == names.size(), images.size() << " pictures with " << names.size() << " names");
  std::vector<std::string> paths(images.size());
  if (std::all_of(images.begin(), images.end(), [](const std::string& jpeg) { return jpeg.empty(); })) {
    if (std::filesystem::exists(folder)) RemoveOurs({folder});
    return paths;
  }
  AtomicFolder place(folder, true);
  for (size_t i = 0; i < images.size(); ++i) {
    if (images[i].empty()) continue;
    paths[i] = folder + "/" + names[i];
    WriteFileAtomic(place.work_path() + "/" + names[i], images[i]);
  }
  place.Commit();
  return paths;
}

}  // namespace mvstudio::stages
