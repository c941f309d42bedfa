#include "calib/check/same_corners.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "core/format.h"

namespace mvstudio::calib {

std::optional<SameCorners> FindSameCorners(const CalibrateInput& input) {
  constexpr int kMinCorners = 4, kMinViews = 3;
  std::map<std::vector<double>, std::map<int, int>> cameras_of;  // what is seen -> camera -> how often
  std::vector<int> num_views(input.cameras.size(), 0);
  for (const Detection& d : input.detections) {
    if (d.num_corners() < kMinCorners) continue;
    ++num_views[static_cast<size_t>(d.camera_idx)];
    std::vector<double> seen = {static_cast<double>(d.board_idx)};
    seen.insert(seen.end(), d.points_px.data(), d.points_px.data() + d.points_px.size());
    ++cameras_of[std::move(seen)][d.camera_idx];
  }
  std::map<std::pair<int, int>, int> same;
  for (const auto& [seen, counts] : cameras_of) {
    for (auto a = counts.begin(); a != counts.end(); ++a) {
      for (auto b = std::next(a); b != counts.end(); ++b) same[{a->first, b->first}] += std::min(a->second, b->second);
    }
  }
  for (const auto& [pair, count] : same) {
    const auto a = static_cast<size_t>(pair.first), b = static_cast<size_t>(pair.second);
    const int views = std::min(num_views[a], num_views[b]);
    if (count >= kMinViews && 2 * count >= views)
      return SameCorners{input.cameras[a].name, input.cameras[b].name, count, views};
  }
  return std::nullopt;
}

std::string ToString(const SameCorners& same) {
  return "cameras " + same.a + " and " + same.b +
         Format(" have the same corners in %d of %d views: both were given one file; give each its own", same.num_same,
                same.num_views);
}

}  // namespace mvstudio::calib
