#include "dataset/build/given_masks.h"

#include <algorithm>
#include <filesystem>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
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

std::optional<Notice> NoticeOfMasksFromOne(const BuildInputs& inputs, const std::map<std::string, GivenMasks>& given) {
  std::vector<std::string> cameras;
  for (const CameraFootage& footage : inputs.footage) {
    const auto found = given.find(footage.camera);
    if (found == given.end() || !fs::is_regular_file(footage.path)) continue;
    const std::map<int64_t, std::string>& files = found->second.files;
    const bool from_one =
        files.size() > 1 && files.begin()->first == 1 && files.rbegin()->first == static_cast<int64_t>(files.size());
    if (from_one) cameras.push_back(footage.camera);
  }
  if (cameras.empty()) return std::nullopt;
  return Notice{"DAT-MASK",
                "masks of " + Join(cameras, ", ") +
                    " are numbered from 1 without a gap, frames of a video count from 0: mask 1 was taken for the second frame",
                "if mask 1 is of the first frame, number the masks of these cameras from 0"};
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
