#include "cli/people/take_images.h"

#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/footage/frames.h"

namespace mvstudio::cli {

std::vector<std::string> ImageArguments::Paths() const { return Joined(PathsIn(video), PathsIn(images)); }

void AddImageArguments(CLI::App* sub, ImageArguments& arguments) {
  const GroupScope report(sub, "Images of the report");
  AddChoices(sub, "--video", arguments.video, "CAMERA=FILE: the footage, for the report's images alone; repeat for each camera")
      ->allow_extra_args(true);
  AddChoices(sub, "--images", arguments.images, "CAMERA=FOLDER or CAMERA=PATTERN: the same of image files");
}

void CheckFootage(const ImageArguments& arguments) {
  for (const std::string& path : arguments.Paths()) dataset::ListFootage(path);
}

double FootageRateHz(const ImageArguments& arguments) {
  double rate_hz = 0;
  for (const stages::NamedPath& camera : arguments.video) {
    const double stated_hz = dataset::DescribeFootage(camera.path).fps_hz;
    if (rate_hz > 0 && !dataset::IsSameRate(rate_hz, stated_hz)) return 0;
    rate_hz = stated_hz;
  }
  return rate_hz;
}

void CheckCameras(const ImageArguments& arguments, const geometry::Rig& rig, const std::string& calib_path) {
  for (const auto* named : {&arguments.video, &arguments.images}) {
    for (const stages::NamedPath& camera : *named) {
      if (rig.Find(camera.name) >= 0) continue;
      throw UsageError("footage of camera " + camera.name + ", which is not in " + calib_path + ": it has " +
                       Join(CameraNames(rig), ", "));
    }
  }
}

stages::TakeImages ImagesOf(const std::optional<stages::FoundTake>& found, const TimingArguments& timing,
                            const ImageArguments& arguments, const FrameNumbering& numbering) {
  stages::TakeImages images{arguments.video, numbering.timeline};
  images.cameras.insert(images.cameras.end(), arguments.images.begin(), arguments.images.end());
  if (!numbering.in_footage) images.cameras.clear();
  if (!found || !images.cameras.empty() || !numbering.in_footage) return images;
  for (const dataset::SessionFootage& footage : found->take.footage) {
    try {
      images.cameras.push_back(
          {footage.camera, dataset::ResolveInSession(found->session, footage.path, timing.session.allow_outside)});
    } catch (const Error&) {  // moved since: a report without its images
    }
  }
  return images;
}

}  // namespace mvstudio::cli
