#include "app/input/picture_pairs.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <mutex>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::app {
namespace {

namespace fs = std::filesystem;

std::map<std::string, std::string> Pictures(const std::string& folder) {
  RequireFolder(folder);
  std::map<std::string, std::string> pictures;
  for (const auto& entry : fs::directory_iterator(folder)) {
    std::string extension = entry.path().extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") continue;
    if (!pictures.emplace(entry.path().stem().string(), entry.path().string()).second) {
      throw FormatError(folder, entry.path().stem().string(), "is there with two extensions; keep one");
    }
  }
  if (pictures.empty()) throw IoError(folder, "holds no PNG or JPEG images");
  return pictures;
}

std::string SizeText(const Image& image) { return std::to_string(image.width) + "x" + std::to_string(image.height); }

Image ReadLike(const std::string& path, const std::string& what, const Image& like, const std::string& like_path, bool grey) {
  Image image = dataset::ReadImage(path, grey);
  if (image.width != like.width || image.height != like.height)
    throw FormatError(path, "", "is " + SizeText(image) + ", " + what + " " + like_path + " is " + SizeText(like));
  return image;
}

void ScorePair(PicturePair* pair) {
  const Image reference = dataset::ReadImage(pair->reference);
  const Image other = ReadLike(pair->other, "its partner", reference, pair->reference, false);
  pair->width = reference.width, pair->height = reference.height;
  const int window = metrics::SsimWindowSize(metrics::SsimWindow::kWang2004);
  if (std::min(reference.width, reference.height) < window)
    throw FormatError(pair->reference, "", "is " + SizeText(reference) + ", smaller than SSIM's window of 11x11 px");
  if (pair->mask.empty()) {
    pair->full = metrics::ScoreWhole(reference, other);
    return;
  }
  const Image grey = ReadLike(pair->mask, "its image", reference, pair->reference, true);
  metrics::Mask mask(grey.pixels.size());
  std::transform(grey.pixels.begin(), grey.pixels.end(), mask.begin(), [](uint8_t v) { return v > 127; });
  if (std::find(mask.begin(), mask.end(), 1) == mask.end()) throw FormatError(pair->mask, "", "is empty: no person is on it");
  const metrics::PictureScore score =
      metrics::ScorePicture(metrics::FromImage(reference), mask, metrics::FromImage(other), mask);
  pair->full = score.full, pair->bbox = score.bbox, pair->masked = score.masked;
}

}  // namespace

PicturePairs PairPictures(const std::string& reference, const std::string& other, const std::string& masks) {
  PicturePairs result;
  if (fs::is_regular_file(reference) && fs::is_regular_file(other)) {
    result.pairs.push_back({fs::path(reference).stem().string(), reference, other, masks, {}, {}, {}, 0, 0});
    return result;
  }
  const auto in_a = Pictures(reference), in_b = Pictures(other);
  const auto of_masks = masks.empty() ? std::map<std::string, std::string>() : Pictures(masks);
  for (const auto& [name, path] : in_a) {
    const auto partner = in_b.find(name);
    if (partner == in_b.end()) {
      result.only_in_reference.push_back(name);
      continue;
    }
    const auto mask = of_masks.find(name);
    if (!masks.empty() && mask == of_masks.end()) throw IoError(masks, "has no mask called " + name);
    result.pairs.push_back({name, path, partner->second, masks.empty() ? "" : mask->second, {}, {}, {}, 0, 0});
  }
  for (const auto& [name, path] : in_b) {
    if (!in_a.count(name)) result.only_in_other.push_back(name);
  }
  if (result.pairs.empty()) throw IoError(other, "no image has the name of one in " + reference);
  return result;
}

void ScorePairs(PicturePairs* pairs, const RunContext& run) {
  const auto count = static_cast<int64_t>(pairs->pairs.size());
  ProgressStage stage(run, "comparing images", count);
  std::mutex mutex;
  ParallelFor(count, ResolveThreads(run.num_threads), [&](int64_t i) {
    ScorePair(&pairs->pairs[static_cast<size_t>(i)]);
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
}

}  // namespace mvstudio::app
