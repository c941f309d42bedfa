#include "avatar/run/pack/person_views.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

constexpr double kFill = 0.85;  // of the crop; room for outlines that have to move outwards

Image Read(const dataset::PanopticDataset& data, const geometry::RigCamera& camera, int frame, bool mask) {
  const std::string& name = camera.camera.name;
  const std::string path = mask ? data.MaskPath(name, frame) : data.ImagePath(name, frame);
  Image image = mask ? data.ReadMask(name, frame) : dataset::ReadImage(path);
  if (image.width != camera.camera.width_px || image.height != camera.camera.height_px)
    throw FormatError(path, "",
                      "is " + std::to_string(image.width) + "x" + std::to_string(image.height) + ", the calibration says " +
                          std::to_string(camera.camera.width_px) + "x" + std::to_string(camera.camera.height_px));
  return image;
}

/// A pinhole view of the person, as fine as the source but not larger than `max_px`.
geometry::RigCamera CropFor(const geometry::RigCamera& camera, const dataset::Coco19Pose& pose, int max_px) {
  const dataset::PersonExtent extent = *dataset::MeasurePerson(pose, camera);
  const double focal = PinholeOf(camera.camera).fx();
  const double source_px = 2 * extent.half_extent_m / extent.middle_in_cam.norm() * focal / kFill;
  const int size = std::clamp(static_cast<int>(std::lround(source_px)), 64, max_px);
  return dataset::CropCamera(camera, extent.middle_in_cam, extent.half_extent_m, kFill, size);
}

}  // namespace

std::vector<PersonStep> FindPersonSteps(const dataset::PanopticDataset& data, int person,
                                        const std::vector<std::string>& cameras, const std::vector<int>& frames,
                                        std::vector<std::string>* missing) {
  std::vector<PersonStep> sources;
  for (const int frame : frames) {
    const auto poses = data.poses.find(frame);
    if (poses == data.poses.end() || !poses->second.count(person)) continue;
    PersonStep source{frame, &poses->second.at(person), {}};
    for (const std::string& name : cameras) {
      const geometry::RigCamera& camera = data.rig.cameras.at(data.rig.Find(name));
      const bool there =
          std::filesystem::exists(data.ImagePath(name, frame)) && std::filesystem::exists(data.MaskPath(name, frame));
      if (!there) missing->push_back("camera " + name + ", frame " + std::to_string(frame));
      if (there && dataset::MeasurePerson(*source.pose, camera)) source.cameras.push_back(&camera);
    }
    if (!source.cameras.empty()) sources.push_back(source);
  }
  return sources;
}

std::vector<PersonStep> ThinnedSteps(const std::vector<PersonStep>& sources, int most) {
  size_t total = 0;
  for (const PersonStep& source : sources) total += source.cameras.size();
  if (total == 0) return {};
  const auto count =
      static_cast<size_t>(std::ceil(static_cast<double>(sources.size()) * std::min(1.0, most / static_cast<double>(total))));
  std::vector<PersonStep> some;
  for (size_t k = 0; k < count; ++k) some.push_back(sources[(2 * k + 1) * sources.size() / (2 * count)]);
  return some;
}

PersonCrop ReadPersonCrop(const dataset::PanopticDataset& data, const PersonStep& source, const geometry::RigCamera& camera,
                          int max_px) {
  PersonCrop crop{CropFor(camera, *source.pose, max_px), {}, {}};
  const dataset::ResampleMap map(camera, crop.camera);
  crop.image = map.Apply(Read(data, camera, source.frame, false));
  crop.mask = map.Apply(Read(data, camera, source.frame, true));
  return crop;
}

std::vector<body::TextureView> ReadTextureViews(const dataset::PanopticDataset& data, const body::PersonBody& person,
                                                const std::vector<PersonStep>& steps, int max_px, const RunContext& run,
                                                std::vector<std::string>* cameras) {
  std::vector<body::TextureView> views;
  ProgressStage stage(run, "reading images", static_cast<int64_t>(steps.size()));
  for (const PersonStep& step : steps) {
    const Eigen::Matrix3Xf vertices = SkinVertices(person.body, ToBodyPose(person.body, person.seen.at(step.frame)));
    for (const geometry::RigCamera* camera : step.cameras) {
      PersonCrop crop = ReadPersonCrop(data, step, *camera, max_px);
      const auto known = std::find(cameras->begin(), cameras->end(), camera->camera.name);
      const auto camera_idx = static_cast<int>(known - cameras->begin());
      if (known == cameras->end()) cameras->push_back(camera->camera.name);
      views.push_back({crop.camera, std::move(crop.image), std::move(crop.mask), vertices, camera_idx});
    }
    stage.Advance();
  }
  return views;
}

}  // namespace mvstudio::avatar
