#include "stages/input/image_file_pairs.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <map>
#include <mutex>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

bool IsImage(const fs::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

void AddImage(const std::string& folder, const fs::path& path, std::map<std::string, std::string>* images) {
  if (!IsImage(path)) return;
  const std::string name = path.lexically_relative(folder).replace_extension("").string();
  if (!images->emplace(name, path.string()).second) throw FormatError(folder, name, "is there with two extensions; keep one");
}

/// Counts the colours of `opaque` where `clear` is wholly clear.
void CountBehind(const Image& clear, const Image& opaque, std::map<std::array<uint8_t, 3>, int64_t>* counts) {
  if (clear.channels != 4 || opaque.channels != 3 || clear.width != opaque.width || clear.height != opaque.height) return;
  for (size_t i = 0; i < clear.pixels.size() / 4; ++i) {
    const uint8_t* const p = opaque.pixels.data() + 3 * i;
    if (clear.pixels[4 * i + 3] == 0) ++(*counts)[{p[0], p[1], p[2]}];
  }
}

std::string SizeText(const Image& image) { return std::to_string(image.width) + "x" + std::to_string(image.height); }

void RequireLike(const Image& image, const std::string& path, const std::string& what, const Image& like,
                 const std::string& like_path) {
  if (image.width != like.width || image.height != like.height)
    throw FormatError(path, "", "is " + SizeText(image) + ", " + what + " " + like_path + " is " + SizeText(like));
}

void ScorePair(const ImageFilePairs& all, ImageFilePair* pair) {
  const Image reference = ReadOver(pair->reference, all.backdrop, &pair->clear);
  const Image other = ReadOver(pair->other, all.backdrop, &pair->clear);
  RequireLike(other, pair->other, "its partner", reference, pair->reference);
  pair->width = reference.width, pair->height = reference.height;
  const int window = metrics::SsimWindowSize(metrics::SsimWindow::kWang2004);
  if (std::min(reference.width, reference.height) < window)
    throw FormatError(pair->reference, "", "is " + SizeText(reference) + ", smaller than SSIM's window of 11x11 px");
  if (pair->mask.empty()) {
    pair->full = metrics::ScoreWhole(reference, other);
    return;
  }
  const Image grey = dataset::ReadMask(pair->mask, all.masks);
  RequireLike(grey, pair->mask, "its image", reference, pair->reference);
  metrics::Mask mask(grey.pixels.size());
  std::transform(grey.pixels.begin(), grey.pixels.end(), mask.begin(), [](uint8_t v) { return v > 127; });
  pair->mask_px = std::count(mask.begin(), mask.end(), 1);
  if (pair->mask_px == 0) throw FormatError(pair->mask, "", "is empty: no person is on it");
  const metrics::ImageScore score = metrics::ScoreImage(metrics::FromImage(reference), mask, metrics::FromImage(other), mask);
  pair->full = score.full, pair->bbox = score.bbox, pair->masked = score.masked;
}

}  // namespace

std::map<std::string, std::string> ImagesIn(const std::string& folder) {
  RequireFolder(folder);
  std::map<std::string, std::string> images;
  for (const auto& entry : fs::directory_iterator(folder)) AddImage(folder, entry.path(), &images);
  if (!images.empty()) return images;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) AddImage(folder, entry.path(), &images);
  if (images.empty()) throw IoError(folder, "holds no PNG or JPEG images, nor does a folder in it");
  return images;
}

Backdrop BackdropOf(const std::string& text) {
  if (text == "black") return {{0, 0, 0}, "as asked for"};
  if (text == "white") return {{255, 255, 255}, "as asked for"};
  int r = -1, g = -1, b = -1, used = 0;
  const bool whole = std::sscanf(text.c_str(), "%d,%d,%d%n", &r, &g, &b, &used) == 3 && used == static_cast<int>(text.size());
  if (!whole || std::min({r, g, b}) < 0 || std::max({r, g, b}) > 255)
    throw UsageError("option 'background' " + text + ": must be auto, black, white or R,G,B with numbers 0 to 255");
  return {{static_cast<uint8_t>(r), static_cast<uint8_t>(g), static_cast<uint8_t>(b)}, "as asked for"};
}

std::string ToString(const Backdrop& backdrop) {
  const auto& [r, g, b] = backdrop.rgb;
  const std::string numbers = std::to_string(r) + "," + std::to_string(g) + "," + std::to_string(b);
  return numbers == "0,0,0" ? "black" : numbers == "255,255,255" ? "white" : "the colour " + numbers;
}

Image ReadOver(const std::string& path, const Backdrop& backdrop, bool* clear) {
  Image image = dataset::ReadImageWithAlpha(path);
  if (image.channels != 4) return image;
  Image rgb(image.width, image.height, 3);
  for (size_t i = 0; i < image.pixels.size() / 4; ++i) {
    const int alpha = image.pixels[4 * i + 3];
    if (clear && alpha < 255) *clear = true;
    for (size_t k = 0; k < 3; ++k) {
      const int value = alpha * image.pixels[4 * i + k] + (255 - alpha) * backdrop.rgb[k];
      rgb.pixels[3 * i + k] = static_cast<uint8_t>((value + 127) / 255);
    }
  }
  return rgb;
}

Backdrop BackdropOf(const std::vector<ImageFilePair>& pairs) {
  constexpr size_t kPairs = 8;
  constexpr double kMost = 0.95;
  std::map<std::array<uint8_t, 3>, int64_t> counts;
  for (size_t i = 0; i < std::min(kPairs, pairs.size()); ++i) {
    const ImageFilePair& pair = pairs[i * pairs.size() / std::min(kPairs, pairs.size())];
    if (dataset::ReadImageHeader(pair.reference).codec != "png" && dataset::ReadImageHeader(pair.other).codec != "png")
      continue;
    const Image a = dataset::ReadImageWithAlpha(pair.reference), b = dataset::ReadImageWithAlpha(pair.other);
    CountBehind(a, b, &counts), CountBehind(b, a, &counts);
  }
  int64_t all = 0, most = 0;
  Backdrop backdrop{{0, 0, 0}, "the default"};
  for (const auto& [rgb, count] : counts) {
    all += count;
    if (count <= most) continue;
    most = count, backdrop.rgb = rgb;
  }
  if (all == 0 || static_cast<double>(most) < kMost * static_cast<double>(all)) return {{0, 0, 0}, "the default"};
  backdrop.reason = "as the images without opacity are there";
  return backdrop;
}

ImageFilePairs PairImages(const std::string& reference, const std::string& other, const std::string& masks) {
  ImageFilePairs result;
  if (fs::is_regular_file(reference) && fs::is_regular_file(other)) {
    result.pairs.push_back({fs::path(reference).stem().string(), reference, other, masks});
    return result;
  }
  const auto in_a = ImagesIn(reference), in_b = ImagesIn(other);
  const auto of_masks = masks.empty() ? std::map<std::string, std::string>() : ImagesIn(masks);
  for (const auto& [name, path] : in_a) {
    const auto partner = in_b.find(name);
    if (partner == in_b.end()) {
      result.only_in_reference.push_back(name);
      continue;
    }
    const auto mask = of_masks.find(name);
    if (!masks.empty() && mask == of_masks.end()) throw IoError(masks, "has no mask called " + name);
    result.pairs.push_back({name, path, partner->second, masks.empty() ? "" : mask->second});
  }
  for (const auto& [name, path] : in_b) {
    if (!in_a.count(name)) result.only_in_other.push_back(name);
  }
  if (result.pairs.empty()) {
    throw IoError(other, "no image has the name of one in " + reference + ": " + in_b.begin()->first + " here, " +
                             in_a.begin()->first + " there; option 'distance-only' compares sets without pairs");
  }
  return result;
}

void ScorePairs(ImageFilePairs* pairs, const RunContext& run) {
  std::vector<std::string> masks;
  for (const ImageFilePair& pair : pairs->pairs) {
    if (!pair.mask.empty()) masks.push_back(pair.mask);
  }
  pairs->masks = dataset::MeaningOfMasks(masks);
  const auto count = static_cast<int64_t>(pairs->pairs.size());
  ProgressStage stage(run, "comparing images", count);
  std::mutex mutex;
  ParallelFor(count, ResolveThreads(run.num_threads), [&](int64_t i) {
    ScorePair(*pairs, &pairs->pairs[static_cast<size_t>(i)]);
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
}

}  // namespace mvstudio::stages
