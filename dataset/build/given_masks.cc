#include "dataset/build/given_masks.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/footage/first_number.h"
#include "dataset/footage/frames.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

bool IsMask(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

void AddFiles(const std::string& folder, GivenMasks* masks) {
  std::vector<std::string> paths;
  for (const std::string& path : FilesIn(folder)) {
    if (IsMask(path)) paths.push_back(path);
  }
  const std::vector<int64_t> numbers = NumberFrames(folder, paths).numbers;
  for (size_t i = 0; i < paths.size(); ++i) {
    const std::string& path = paths[i];
    if (!NumberInName(path))
      throw FormatError(path, "", "its name has no number: masks are found by the number of their frame");
    const auto [at, is_new] = masks->files.emplace(numbers[i], path);
    if (!is_new)
      throw FormatError(path, "",
                        "is a second mask of frame " + std::to_string(numbers[i]) + ", beside " + at->second + "; keep one");
  }
}

[[noreturn]] void FailWithoutMasks(const BuildInputs& inputs) {
  for (const CameraFootage& footage : inputs.footage) {
    const fs::path folder = fs::path(inputs.masks) / footage.camera;
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
      throw IoError(folder.string(), "holds `" + entry.path().filename().string().substr(0, 80) +
                                         "` and no mask: give one .png or .jpg a frame in it, the objects of a frame in one "
                                         "image");
    }
  }
  throw IoError(inputs.masks, "holds masks of none of the cameras; it must have a folder for each: " +
                                  Join(inputs.footage, ", ", &CameraFootage::camera));
}

/// Mask `first` is of frame 0.
void CountFrom(int first, GivenMasks* masks) {
  if (!masks->files.empty() && masks->files.begin()->first < first)
    throw FormatError(masks->files.begin()->second, "",
                      "has a number below option 'first-mask' " + std::to_string(first) + ", which is that of the first frame");
  NumberFrom(first, &masks->files);
}

}  // namespace

std::map<std::string, GivenMasks> FindGivenMasks(const BuildInputs& inputs) {
  std::map<std::string, GivenMasks> all;
  if (inputs.masks.empty()) return all;
  if (!fs::is_directory(inputs.masks)) {
    throw IoError(inputs.masks,
                  fs::exists(inputs.masks)
                      ? "is a file; masks are images, FOLDER/CAMERA/FRAME.png: write those of COCO's RLE, of arrays "
                        "and of videos as PNG, 0 and 255"
                      : "no such folder of masks");
  }
  std::vector<std::string> paths;
  for (const CameraFootage& footage : inputs.footage) {
    GivenMasks& masks = all[footage.camera];
    AddFiles(inputs.masks + "/" + footage.camera, &masks);
    for (const auto& [frame, path] : masks.files) paths.push_back(path);
  }
  if (paths.empty()) FailWithoutMasks(inputs);
  const MaskMeaning meaning = MeaningOfMasks(paths);
  for (auto& [camera, masks] : all) masks.meaning = meaning;
  return all;
}

std::vector<Notice> NumberMasksAsFrames(const BuildInputs& inputs, std::map<std::string, GivenMasks>* given) {
  std::vector<std::string> moved, unclear;
  for (const CameraFootage& footage : inputs.footage) {
    const auto found = given->find(footage.camera);
    if (found == given->end()) continue;
    if (inputs.first_mask != 0) {
      CountFrom(inputs.first_mask, &found->second);
      continue;
    }
    std::set<int64_t> numbers;
    for (const auto& [number, path] : found->second.files) numbers.insert(number);
    if (numbers.empty() || *numbers.begin() == 0) continue;
    const std::optional<int64_t> num_frames = FramesFrom0(footage.path);
    const FirstNumber first = num_frames ? FirstNumberOf(numbers, *num_frames) : FirstNumber::kAsFrames;
    if (first == FirstNumber::kOne) CountFrom(1, &found->second), moved.push_back(footage.camera);
    if (first == FirstNumber::kUnclear) unclear.push_back(footage.camera);
  }
  std::vector<Notice> notices;
  if (!moved.empty())
    notices.push_back(
        {"DAT-MASK",
         "masks of " + Join(moved, ", ") +
             " are numbered 1 to N and the N frames of the footage 0 to N - 1: mask 1 was taken for the first frame",
         "number masks as frames, from 0, and nothing is said"});
  if (!unclear.empty())
    notices.push_back(
        {"DAT-MASK",
         "masks of " + Join(unclear, ", ") +
             " are numbered from 1, or beyond the last frame, and frames count from 0: mask 1 was taken for the second "
             "frame",
         "if mask 1 is of the first frame, option 'first-mask' 1 says so"});
  return notices;
}

Image GivenMask(const GivenMasks& masks, int64_t frame, int width, int height) {
  const auto found = masks.files.find(frame);
  if (found == masks.files.end()) return {};
  Image mask = ReadMask(found->second, masks.meaning);
  if (mask.width != width || mask.height != height)
    throw FormatError(found->second, "",
                      "is " + std::to_string(mask.width) + "x" + std::to_string(mask.height) + ", the footage is " +
                          std::to_string(width) + "x" + std::to_string(height) +
                          ": write the masks at the size of the images (of labels without smoothing)");
  return mask;
}

}  // namespace mvstudio::dataset::internal
