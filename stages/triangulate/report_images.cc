#include "stages/triangulate/report_images.h"

#include "core/error.h"
#include "core/join.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/footage/frames.h"

namespace mvstudio::stages {

std::vector<std::string> FootagePaths(const TriangulateOptions& options) {
  std::vector<std::string> paths;
  for (const auto* named : {&options.video, &options.images}) {
    for (const NamedPath& camera : *named) paths.push_back(camera.path);
  }
  return paths;
}

void CheckFootage(const TriangulateOptions& options) {
  for (const std::string& path : FootagePaths(options)) dataset::ListFootage(path);
}

double FootageRateHz(const TriangulateOptions& options) {
  double rate_hz = 0;
  for (const NamedPath& camera : options.video) {
    const double stated_hz = dataset::DescribeFootage(camera.path).fps_hz;
    if (rate_hz > 0 && !dataset::IsSameRate(rate_hz, stated_hz)) return 0;
    rate_hz = stated_hz;
  }
  return rate_hz;
}

void CheckFootageCameras(const TriangulateOptions& options, const geometry::Rig& rig) {
  for (const auto* named : {&options.video, &options.images}) {
    for (const NamedPath& camera : *named) {
      if (rig.Find(camera.name) >= 0) continue;
      throw UsageError("footage of camera " + camera.name + ", which is not in " + options.pose.calib + ": it has " +
                       Join(CameraNames(rig), ", "));
    }
  }
}

TakeImages ImagesOf(const std::optional<FoundTake>& found, const TriangulateOptions& options, const TakeTiming& timing) {
  TakeImages images{options.video, timing.timeline};
  images.cameras.insert(images.cameras.end(), options.images.begin(), options.images.end());
  if (!timing.in_footage) images.cameras.clear();
  if (!found || !images.cameras.empty() || !timing.in_footage) return images;
  for (const dataset::SessionFootage& footage : found->take.footage) {
    try {
      images.cameras.push_back(
          {footage.camera, dataset::ResolveInSession(found->session, footage.path, options.session.allow_outside)});
    } catch (const Error&) {  // moved since: a report without its images
    }
  }
  return images;
}

}  // namespace mvstudio::stages
