#pragma once

#include <string>
#include <vector>

#include "avatar/body/fit/person_body.h"
#include "avatar/body/texture/view_sampler.h"
#include "core/image.h"
#include "core/progress.h"
#include "dataset/panoptic/panoptic.h"
#include "geometry/rig/rig.h"

/// The images that a person's body and colours are taken from.
namespace mvstudio::avatar {

/// Where the images of a time step lie.
struct PersonStep {
  int frame = 0;
  const dataset::Coco19Pose* pose = nullptr;
  std::vector<const geometry::RigCamera*> cameras;  ///< that have an image and a mask
};

/// The time steps of `frames` in which a camera of `cameras` shows the person. What has no image or no mask is added to
/// `missing`, as "camera 00_03, frame 17".
std::vector<PersonStep> FindPersonSteps(const dataset::PanopticDataset& data, int person,
                                        const std::vector<std::string>& cameras, const std::vector<int>& frames,
                                        std::vector<std::string>* missing);

/// Evenly spread time steps with at most `most` images, but with one step.
std::vector<PersonStep> ThinnedSteps(const std::vector<PersonStep>& steps, int most);

/// A pinhole view of the person, as fine as the image but not larger than `max_px`.
struct PersonCrop {
  geometry::RigCamera camera;
  Image image, mask;
};
/// Throws IoError, or FormatError for an image of another size than the calibration's.
PersonCrop ReadPersonCrop(const dataset::PanopticDataset& data, const PersonStep& step, const geometry::RigCamera& camera,
                          int max_px);

/// The crops of steps in which the body was posed (`person.seen`), with their cameras' places in `cameras`, where those that
/// are new are added.
std::vector<body::TextureView> ReadTextureViews(const dataset::PanopticDataset& data, const body::PersonBody& person,
                                                const std::vector<PersonStep>& steps, int max_px, const RunContext& run,
                                                std::vector<std::string>* cameras);

}  // namespace mvstudio::avatar
