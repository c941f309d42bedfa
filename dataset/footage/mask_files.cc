#include "dataset/footage/mask_files.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/text/words.h"
#include "dataset/footage/first_number.h"
#include "dataset/footage/frame_numbers.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using MaskPaths = std::vector<std::string>;

/// PNG and JPEG; others where there are none of these, since they may be something else beside the masks.
MaskPaths MasksIn(const std::string& folder) {
  static const std::set<std::string> kUsual = {".png", ".jpg", ".jpeg"}, kOthers = {".tif", ".tiff", ".bmp", ".webp", ".pgm"};
  MaskPaths masks, others;
  for (const std::string& path : FilesIn(folder)) {
    const std::string extension = PlainWord(fs::path(path).extension().string());
    if (kUsual.count(extension) > 0) masks.push_back(path);
    if (kOthers.count(extension) > 0) others.push_back(path);
  }
  return masks.empty() ? others : masks;
}

MaskPaths FoldersIn(const std::string& folder) {
  MaskPaths folders;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_directory()) folders.push_back(entry.path().string());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

void AddObject(int64_t frame, const std::string& path, FrameMasks* masks) {
  if (!masks->files.emplace(frame, path).second) masks->objects[frame].push_back(path);
}

/// FRAME_OBJECT.png, where the last number comes again and again, and not one pair does: the number before is the frame.
bool AddObjectsOfNames(const MaskPaths& paths, FrameMasks* masks) {
  std::set<int64_t> frames, objects;
  std::set<std::pair<int64_t, int64_t>> pairs;
  std::vector<int64_t> numbers;
  for (const std::string& path : paths) {
    const std::string stem = fs::path(path).stem().string();
    const size_t end = stem.find_last_of("0123456789"), begin = stem.find_last_not_of("0123456789", end);
    const auto object = NumberInName(path);
    const auto frame = begin == std::string::npos ? std::nullopt : NumberInName(stem.substr(0, begin + 1) + ".png");
    if (!object || !frame || !pairs.insert({*frame, *object}).second) return false;
    frames.insert(*frame), objects.insert(*object), numbers.push_back(*frame);
  }
  if (objects.size() == paths.size() || objects.size() >= frames.size()) return false;
  for (size_t i = 0; i < paths.size(); ++i) AddObject(numbers[i], paths[i], masks);
  return true;
}

/// Whether each name must have the number of its frame, rather than the files their positions where none has one.
enum class MaskNames { kNumbered, kAny };

void AddFiles(const std::string& folder, const MaskPaths& paths, MaskNames names, FrameMasks* masks) {
  const std::vector<int64_t> numbers = NumberFrames(folder, paths).numbers;
  if (std::set<int64_t>(numbers.begin(), numbers.end()).size() < paths.size() && AddObjectsOfNames(paths, masks)) return;
  for (size_t i = 0; i < paths.size(); ++i) {
    const std::string& path = paths[i];
    if (names == MaskNames::kNumbered && !NumberInName(path))
      throw FormatError(path, "", "its name has no number: masks are found by the number of their frame");
    const auto [at, is_new] = masks->files.emplace(numbers[i], path);
    if (!is_new)
      throw FormatError(path, "",
                        "is a second mask of frame " + std::to_string(numbers[i]) + ", beside " + at->second + "; keep one");
  }
}

/// Folders in that of a camera: one for all its masks, for each object, or for each frame.
void AddFolders(const std::string& folder, MaskNames names, FrameMasks* masks) {
  std::vector<std::pair<std::string, MaskPaths>> inside;
  size_t most = 0;
  for (const std::string& path : FoldersIn(folder)) {
    if (MaskPaths files = MasksIn(path); !files.empty()) most = std::max(most, files.size()), inside.emplace_back(path, files);
  }
  if (inside.size() == 1 && (most > 1 || !NumberInName(inside[0].first)))
    return AddFiles(inside[0].first, inside[0].second, names, masks);
  if (inside.size() == most) return;  // frames or objects
  for (const auto& [path, files] : inside) {
    for (const std::string& file : files) {
      const auto frame = NumberInName(inside.size() > most ? path : file);
      if (frame) AddObject(*frame, file, masks);
    }
  }
}

/// The folder of a camera, in its spelling before all others; empty: there is none.
std::string FolderOfCamera(const std::string& in, const std::string& camera, const std::vector<std::string>& cameras) {
  std::string found = in + "/" + camera;
  if (fs::is_directory(found)) return found;
  found.clear();
  for (const std::string& path : FoldersIn(in)) {
    const std::string name = fs::path(path).filename().string();
    if (PlainWord(name) != PlainWord(camera) || std::count(cameras.begin(), cameras.end(), name) > 0) continue;
    if (!found.empty()) return "";
    found = path;
  }
  return found;
}

/// CAMERA, CAMERA_anything: how many letters of the stem are the camera's name; 0: none. `spelled`: letter for letter.
size_t LettersOf(const std::string& camera, const std::string& stem, bool spelled) {
  for (size_t end = 1; end <= stem.size(); ++end) {
    if (end < stem.size() && std::isalnum(static_cast<unsigned char>(stem[end]))) continue;
    const std::string name = stem.substr(0, end);
    if (spelled ? name == camera : PlainWord(name) == PlainWord(camera)) return end;
  }
  return 0;
}

/// Of several cameras whose names begin the file's the longest counts, in its own spelling before all others.
bool IsOfCamera(const std::string& path, const std::string& camera, const std::vector<std::string>& cameras) {
  const std::string stem = fs::path(path).stem().string();
  const auto rank = [&](const std::string& name) {
    const size_t spelled = LettersOf(name, stem, true);
    return std::pair(spelled, spelled > 0 ? 0 : LettersOf(name, stem, false));
  };
  const auto own = rank(camera);
  return own != std::pair<size_t, size_t>() &&
         std::none_of(cameras.begin(), cameras.end(), [&](const auto& other) { return other != camera && rank(other) > own; });
}

FrameMasks MasksOf(const std::string& folder_or_pattern, MaskNames names) {
  FrameMasks masks;
  const bool is_folder = fs::is_directory(folder_or_pattern);
  const MaskPaths files = is_folder ? MasksIn(folder_or_pattern) : FilesMatching(folder_or_pattern);
  if (files.empty() && is_folder) {
    AddFolders(folder_or_pattern, names, &masks);
  } else {
    AddFiles(folder_or_pattern, files, names, &masks);
  }
  return masks;
}

/// Another object of the same frame.
void JoinObject(const Image& object, const std::string& path, Image* mask) {
  if (object.width != mask->width || object.height != mask->height)
    throw FormatError(path, "", "has another size than the other objects of its frame");
  for (size_t i = 0; i < object.pixels.size(); ++i) mask->pixels[i] = std::max(mask->pixels[i], object.pixels[i]);
}

/// At another size; what is half covered and more is the person, unless the mask is soft.
Image AtSize(const Image& mask, int width, int height, bool soft) {
  Image out(width, height, 1);
  const cv::Mat from(mask.height, mask.width, CV_8UC1, const_cast<uint8_t*>(mask.pixels.data()));
  cv::Mat to(height, width, CV_8UC1, out.pixels.data());
  cv::resize(from, to, to.size(), 0, 0, width < mask.width ? cv::INTER_AREA : cv::INTER_LINEAR);
  if (!soft) cv::threshold(to, to, 127, 255, cv::THRESH_BINARY);
  return out;
}

}  // namespace

std::vector<std::string> FrameMasks::Paths() const {
  std::vector<std::string> paths;
  for (const auto& [frame, path] : files) paths.push_back(path);
  for (const auto& [frame, further] : objects) paths.insert(paths.end(), further.begin(), further.end());
  return paths;
}

void FrameMasks::CountFrom(int first) { NumberFrom(first, &files), NumberFrom(first, &objects); }

FrameMasks FindMasks(const std::string& folder_or_pattern) { return MasksOf(folder_or_pattern, MaskNames::kAny); }

FrameMasks FindMasks(const std::string& in, const std::string& camera, const std::vector<std::string>& cameras) {
  const std::string folder = FolderOfCamera(in, camera, cameras);
  if (!folder.empty()) return MasksOf(folder, MaskNames::kNumbered);
  FrameMasks masks;
  MaskPaths flat;
  for (const std::string& path : MasksIn(in)) {
    if (IsOfCamera(path, camera, cameras) && PlainWord(fs::path(path).stem().string()) != PlainWord(camera))
      flat.push_back(path);
  }
  if (!flat.empty()) AddFiles(in, flat, MaskNames::kNumbered, &masks);
  for (const std::string& step : flat.empty() ? FoldersIn(in) : MaskPaths()) {
    const auto frame = NumberInName(step);
    if (!frame) continue;
    for (const std::string& path : MasksIn(step)) {
      if (IsOfCamera(path, camera, cameras)) AddObject(*frame, path, &masks);
    }
  }
  return masks;
}

Image MaskOfFrame(const FrameMasks& masks, int64_t frame, int width, int height) {
  const auto found = masks.files.find(frame);
  if (found == masks.files.end()) return {};
  Image mask = ReadMask(found->second, masks.meaning);
  const auto objects = masks.objects.find(frame);
  if (objects != masks.objects.end()) {
    for (const std::string& path : objects->second) JoinObject(ReadMask(path, masks.meaning), path, &mask);
  }
  if (mask.width == width && mask.height == height) return mask;
  const auto differ = std::abs(static_cast<double>(mask.width) * height - static_cast<double>(mask.height) * width);
  if (differ <= std::max(width, height) && mask.width >= width / 8)  // a side is rounded
    return AtSize(mask, width, height, masks.meaning.form == MaskMeaning::Form::kSoft);
  throw FormatError(found->second, "",
                    "is " + std::to_string(mask.width) + "x" + std::to_string(mask.height) + ", the footage is " +
                        std::to_string(width) + "x" + std::to_string(height) +
                        (mask.width == height && mask.height == width
                             ? ": rotated by 90 degrees; write the masks as the images are shown (EXIF rotates those)"
                             : ", of another shape: write the masks at the size of the images, without bars (of labels without "
                               "smoothing)"));
}

}  // namespace mvstudio::dataset
