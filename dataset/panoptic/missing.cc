#include "dataset/panoptic/missing.h"

#include <algorithm>
#include <filesystem>

#include "dataset/json/json_file.h"

namespace mvstudio::dataset {
namespace {

constexpr int kMostNames = 20, kMostCameras = 6;

int Count(const MissingImages& missing, const std::set<int> MissingOfCamera::*frames) {
  int count = 0;
  for (const auto& [camera, of] : missing.by_camera) count += static_cast<int>((of.*frames).size());
  return count;
}

/// Names of the missing images, camera by camera, at most `most`.
std::vector<std::string> Names(const MissingImages& missing, int most) {
  std::vector<std::string> names;
  for (const auto& [camera, of] : missing.by_camera) {
    std::map<int, const char*> reasons;
    for (const int frame : of.no_image) reasons[frame] = "no image";
    for (const int frame : of.no_mask) reasons[frame] = "no mask";
    for (const auto& [frame, reason] : reasons) {
      if (static_cast<int>(names.size()) == most) return names;
      names.push_back("camera " + camera + ", frame " + std::to_string(frame) + ": " + reason);
    }
  }
  return names;
}

}  // namespace

int MissingImages::asked() const {
  int count = 0;
  for (const auto& [camera, of] : by_camera) count += of.asked;
  return count;
}

int MissingImages::missing() const {
  return Count(*this, &MissingOfCamera::no_image) + Count(*this, &MissingOfCamera::no_mask);
}

bool MissingImages::Has(const std::string& camera, int frame) const {
  const auto found = by_camera.find(camera);
  return found != by_camera.end() && (found->second.no_image.count(frame) || found->second.no_mask.count(frame));
}

std::vector<std::string> MissingImages::CamerasWithout() const {
  std::vector<std::string> names;
  for (const auto& [camera, of] : by_camera) {
    if (of.asked > 0 && of.missing() == of.asked) names.push_back(camera);
  }
  return names;
}

MissingImages FindMissing(const PanopticDataset& dataset, const std::vector<std::string>& cameras,
                          const std::vector<int>& frames, bool masks) {
  namespace fs = std::filesystem;
  const std::set<int> asked(frames.begin(), frames.end());
  MissingImages missing;
  for (const std::string& camera : cameras) {
    MissingOfCamera& of = missing.by_camera[camera];
    of.asked = static_cast<int>(asked.size());
    for (const int frame : asked) {
      if (!fs::exists(dataset.ImagePath(camera, frame))) {
        of.no_image.insert(frame);
      } else if (masks && !fs::exists(dataset.MaskPath(camera, frame))) {
        of.no_mask.insert(frame);
      }
    }
  }
  return missing;
}

std::string MissingCamerasText(const MissingImages& missing) {
  std::string text;
  int told = 0, more = 0;
  for (const auto& [camera, of] : missing.by_camera) {
    if (of.missing() == 0) continue;
    if (told == kMostCameras) {
      ++more;
      continue;
    }
    text += (told++ ? ", " : "") + camera + ": " + std::to_string(of.missing()) + " of " + std::to_string(of.asked);
  }
  return text + (more > 0 ? " and " + std::to_string(more) + " more cameras" : "");
}

std::string MissingText(const MissingImages& missing) {
  const int masks = Count(missing, &MissingOfCamera::no_mask), all = missing.missing();
  const std::string why = masks == 0     ? "are not in the dataset"
                          : masks == all ? "have no mask"
                                         : "are not in the dataset or, " + std::to_string(masks) + " of them, have no mask";
  return std::to_string(all) + " of " + std::to_string(missing.asked()) + " images " + why +
         (all > 0 ? " (" + MissingCamerasText(missing) + ")" : "");
}

std::string MissingHint(const MissingImages& missing) {
  if (Count(missing, &MissingOfCamera::no_image) == 0) return "make the masks with `mvstudio mask`; what there is was taken";
  const bool sparse = std::any_of(missing.by_camera.begin(), missing.by_camera.end(),
                                  [](const auto& of) { return 2 * of.second.missing() > of.second.asked; });
  return sparse
             ? "the dataset holds only some frames of these cameras; what there is was taken"
             : "images or masks that were lost or not copied? `mvstudio dataset verify` counts them; what there is was taken";
}

std::string MissingToJsonText(const MissingImages& missing) {
  internal::Json json = {{"asked", missing.asked()},
                         {"missing", missing.missing()},
                         {"pictures", Count(missing, &MissingOfCamera::no_image)},
                         {"masks", Count(missing, &MissingOfCamera::no_mask)},
                         {"cameras", internal::Json::object()},
                         {"names", Names(missing, kMostNames)}};
  for (const auto& [camera, of] : missing.by_camera) {
    if (of.missing() > 0)
      json["cameras"][camera] = {{"asked", of.asked}, {"pictures", of.no_image.size()}, {"masks", of.no_mask.size()}};
  }
  return json.dump();
}

}  // namespace mvstudio::dataset
