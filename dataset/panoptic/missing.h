#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "dataset/panoptic/panoptic.h"

/// A dataset need not hold every image of every camera. What it does not hold is left out, counted and listed; a file
/// that exists and is damaged or of another size is an error.
namespace mvstudio::dataset {

/// Frames of one camera that cannot be used.
struct MissingOfCamera {
  int asked = 0;           ///< frames asked for
  std::set<int> no_image;  ///< frame numbers
  std::set<int> no_mask;   ///< the image exists, its mask does not
  int missing() const { return static_cast<int>(no_image.size() + no_mask.size()); }
};

struct MissingImages {
  std::map<std::string, MissingOfCamera> by_camera;  ///< all cameras that were asked for

  int asked() const;
  int missing() const;
  bool Has(const std::string& camera, int frame) const;
  /// Cameras of which every frame that was asked for is missing.
  std::vector<std::string> CamerasWithout() const;
};

/// Those of `cameras` (Panoptic names) in `frames` whose image or, with `masks`, whose mask does not exist. Only names
/// are looked at.
MissingImages FindMissing(const PanopticDataset& dataset, const std::vector<std::string>& cameras,
                          const std::vector<int>& frames, bool masks = true);

/// "285 of 300 images are not in the dataset (00_01: 95 of 100, 00_02: 95 of 100, …)".
std::string MissingText(const MissingImages& missing);
/// "00_01: 95 of 100, 00_02: 95 of 100": those that miss some, at most six.
std::string MissingCamerasText(const MissingImages& missing);
/// The likely cause, and what can be done.
std::string MissingHint(const MissingImages& missing);
/// {"asked", "missing", "pictures", "masks", "cameras": {"00_01": {"asked", "pictures", "masks"}}, "names": […]}: cameras
/// that miss some, and at most 20 names like "camera 00_01, frame 3: no image".
std::string MissingToJsonText(const MissingImages& missing);

}  // namespace mvstudio::dataset
