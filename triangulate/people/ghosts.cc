#include "triangulate/people/ghosts.h"

#include <algorithm>

#include "core/statistics.h"

namespace mvstudio::triangulate {
namespace {

constexpr double kFewViews = 2.5;
constexpr int kFewFrames = 2, kManyFrames = 10;

}  // namespace

int CountChances(const PreparedRig& rig, const Cluster& cluster) {
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const auto& joint : cluster.joints) {
      if (joint) values.push_back((*joint)[axis]);
    }
    if (values.empty()) return 0;
    middle[axis] = UpperMedian(std::move(values));
  }
  return static_cast<int>(std::count_if(rig.cameras.begin(), rig.cameras.end(), [&](const PreparedCamera& camera) {
    const geometry::Projection image = camera.projector.Project(camera.ToCam(middle));
    return image.status == Status::kOk && geometry::InImage(camera.projector.camera(), image.px);
  }));
}

std::vector<bool> FindGhosts(const std::vector<TrackSupport>& tracks, int num_frames) {
  std::vector<bool> is_ghost;
  for (const TrackSupport& track : tracks) {
    const TrackSupport& best = tracks.front();
    const bool few_views = track.num_views <= kFewViews;
    const bool rarely_seen = 2 * track.num_views * best.num_chances < best.num_views * track.num_chances;
    const bool brief = num_frames >= kManyFrames && track.num_frames <= kFewFrames;
    is_ghost.push_back(few_views && (rarely_seen || brief));
  }
  return is_ghost;
}

}  // namespace mvstudio::triangulate
