#include "dataset/masks/sheet.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "dataset/masks/patch.h"

namespace mvstudio::dataset {
namespace {

cv::Rect CropOf(const SheetTile& tile, bool crop) {
  const cv::Rect all(0, 0, tile.rgb.width, tile.rgb.height);
  cv::Rect box = cv::boundingRect(internal::View(tile.mask));
  if (!tile.truth.empty()) box |= cv::boundingRect(internal::View(tile.truth));
  if (!crop || box.empty()) return all;
  const int pad = 8 + std::max(box.width, box.height) / 8;
  return cv::Rect(box.x - pad, box.y - pad, box.width + 2 * pad, box.height + 2 * pad) & all;
}

cv::Mat Tile(const SheetTile& tile, int tile_px, bool crop) {
  MVS_CHECK(tile.mask.width == tile.rgb.width && tile.mask.height == tile.rgb.height, "a tile's sizes differ");
  const cv::Rect box = CropOf(tile, crop);
  const double scale = tile_px / double(std::max(box.width, box.height));
  const cv::Size size(std::max(1, int(box.width * scale)), std::max(1, int(box.height * scale)));
  cv::Mat image, mask, truth, eroded;
  cv::resize(internal::View(tile.rgb)(box), image, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  cv::resize(internal::View(tile.mask)(box), mask, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_NEAREST);
  mask = mask > 127;
  if (tile.truth.empty()) {
    cv::erode(mask, eroded, cv::Mat());
    image.setTo(cv::Scalar(0, 255, 0), mask & ~eroded);
    return image;
  }
  cv::resize(internal::View(tile.truth)(box), truth, size, 0, 0, cv::INTER_NEAREST);
  image.setTo(cv::Scalar(255, 0, 0), mask & ~truth);
  image.setTo(cv::Scalar(0, 0, 255), truth & ~mask);
  return image;
}

}  // namespace

Image ContactSheet(const std::vector<SheetTile>& tiles, int columns, int tile_px, bool crop) {
  MVS_CHECK(columns > 0 && tile_px > 0, "a sheet has columns and tiles a size");
  constexpr int kGap = 4;
  std::vector<cv::Mat> images;
  cv::Size largest(1, 1);
  for (const SheetTile& tile : tiles) {
    images.push_back(Tile(tile, tile_px, crop));
    largest.width = std::max(largest.width, images.back().cols), largest.height = std::max(largest.height, images.back().rows);
  }
  const int n = int(images.size()), used = std::max(1, std::min(columns, n)), rows = std::max(1, (n + columns - 1) / columns);
  Image sheet(used * (largest.width + kGap) + kGap, rows * (largest.height + kGap) + kGap, 3, 255);
  const cv::Mat view = internal::View(sheet);
  for (int i = 0; i < n; ++i) {
    const cv::Point at(kGap + (i % columns) * (largest.width + kGap), kGap + (i / columns) * (largest.height + kGap));
    images[i].copyTo(view(cv::Rect(at, images[i].size())));
  }
  return sheet;
}

}  // namespace mvstudio::dataset
