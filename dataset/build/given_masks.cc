#include "dataset/build/given_masks.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <set>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/footage/first_number.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

std::string MaskExtension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension;
}

/// What a file that is no image holds, where masks come so.
std::string ContainerOf(const fs::path& path) {
  const std::string extension = MaskExtension(path);
  static const std::map<std::string, const char*> kKinds = {
      {".npy", "an array"},         {".npz", "arrays"},  {".json", "RLE or polygons"},
      {".txt", "polygons of YOLO"}, {".mp4", "a video"}, {".mkv", "a video"},
      {".avi", "a video"},          {".mov", "a video"}, {".pkl", "a Python pickle"},
      {".pt", "tensors"},           {".h5", "HDF5"},     {".xml", "annotations"},
      {".gif", "an animated image"}};
  const auto kind = kKinds.find(extension);
  return kind == kKinds.end() ? "" : std::string(" (") + kind->second + ")";
}

constexpr char kWrite[] = "write the masks as images, FOLDER/CAMERA/FRAME.png, 255 the person and 0 the background";

[[noreturn]] void FailWithoutMasks(const BuildInputs& inputs) {
  const auto refuse = [](const std::string& folder) {
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
      if (entry.is_directory() && fs::is_empty(entry.path(), error)) continue;
      throw IoError(folder, "holds `" + entry.path().filename().string().substr(0, 80) + "`" + ContainerOf(entry.path()) +
                                " and no mask of a camera by the number of its frame: " + kWrite +
                                ", the objects of a frame in "
                                "one image");
    }
  };
  for (const CameraFootage& footage : inputs.footage) refuse(inputs.masks + "/" + footage.camera);
  for (const std::string& path : FilesIn(inputs.masks)) {
    if (!ContainerOf(path).empty()) refuse(inputs.masks);
  }
  throw IoError(inputs.masks, "holds masks of none of the cameras; it must have a folder for each: " +
                                  Join(inputs.footage, ", ", &CameraFootage::camera));
}

/// Mask `first` is of frame 0.
void CountFrom(int first, GivenMasks* masks) {
  if (!masks->files.empty() && masks->files.begin()->first < first)
    throw FormatError(masks->files.begin()->second, "",
                      "has a number below option 'first-mask' " + std::to_string(first) + ", which is that of the first frame");
  masks->CountFrom(first);
}

/// What is said of masks that are not taken as they are.
void NoteJoinedAndResized(const BuildInputs& inputs, const std::map<std::string, GivenMasks>& given,
                          std::vector<Notice>* notices) {
  std::string joined, resized;
  for (const CameraFootage& footage : inputs.footage) {
    const auto found = given.find(footage.camera);
    if (found == given.end() || found->second.files.empty()) continue;
    if (!found->second.objects.empty()) joined += (joined.empty() ? "" : ", ") + footage.camera;
    const std::string& file = found->second.files.begin()->second;
    try {
      const ImageHeader mask = ReadImageHeader(file);
      const FootageInfo images = DescribeFootage(footage.path);
      if (mask.width != images.width || mask.height != images.height)
        resized += (resized.empty() ? "" : ", ") + footage.camera + " from " + std::to_string(mask.width) + "x" +
                   std::to_string(mask.height);
    } catch (const Error&) {
      continue;  // who reads them says why
    }
  }
  if (!joined.empty())
    notices->push_back({"DAT-MASK",
                        "masks of " + joined + " have a file for each object: all objects of a frame are the person",
                        "leave out the files of objects that are no person"});
  if (!resized.empty())
    notices->push_back({"DAT-MASK", "masks have another size than the footage and are brought to it: " + resized,
                        "masks at the size of the images have finer outlines"});
}

}  // namespace

std::map<std::string, GivenMasks> FindGivenMasks(const BuildInputs& inputs) {
  std::map<std::string, GivenMasks> all;
  if (inputs.masks.empty()) return all;
  if (!fs::is_directory(inputs.masks)) {
    throw IoError(inputs.masks, fs::exists(inputs.masks) ? "is a file" + ContainerOf(inputs.masks) + ", no folder: " + kWrite +
                                                               ", those of COCO's RLE, too"
                                                         : "no such folder of masks");
  }
  std::vector<std::string> paths, cameras;
  for (const CameraFootage& footage : inputs.footage) cameras.push_back(footage.camera);
  for (const std::string& camera : cameras) {
    const std::vector<std::string> of_camera = (all[camera] = FindMasks(inputs.masks, camera, cameras)).Paths();
    paths.insert(paths.end(), of_camera.begin(), of_camera.end());
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
  NoteJoinedAndResized(inputs, *given, &notices);
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

}  // namespace mvstudio::dataset::internal
