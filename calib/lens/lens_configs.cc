#include "calib/lens/lens_configs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "calib/bundle/view_clusters.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr double kWideRad = 0.70;        // corners farther from the axis than this make fisheye models worth a try
constexpr double kVeryWideRad = 1.55;    // beyond this, perspective models are not
constexpr int kMinSplineCorners = 5000;  // of one camera, one view of each place of the board

double LargestAngleOf(const LensPool& pool) {
  double angle = 0;
  for (size_t c = 0; c < pool.state.cameras.size(); ++c) {
    std::vector<View> of_camera;
    for (const View& view : pool.views) {
      if (view.camera_idx == static_cast<int>(c)) of_camera.push_back(view);
    }
    angle = std::max(angle, LargestAngle(pool.state.cameras[c], of_camera));
  }
  return angle;
}

/// The most corners that one camera has if each place of the board counts once, by its fullest view.
int LargestIndependentCorners(const LensPool& pool) {
  std::vector<std::map<int, int>> fullest(pool.state.cameras.size());  // [camera]: cluster -> corners
  for (size_t v = 0; v < pool.views.size(); ++v) {
    const View& view = pool.views[v];
    int& corners = fullest[view.camera_idx][pool.cluster[v]];
    corners = std::max(corners, static_cast<int>((view.weights.array() > 0).count()));
  }
  int largest = 0;
  for (const std::map<int, int>& of_camera : fullest) {
    int sum = 0;
    for (const auto& [cluster, corners] : of_camera) sum += corners;
    largest = std::max(largest, sum);
  }
  return largest;
}

/// Places of the board that a lens is seen with: those of a usual camera, or of all that share it.
int PlacesOf(const LensPool& pool, bool shared) {
  std::vector<int> places = ClustersOfCameras(pool);
  return shared ? std::accumulate(places.begin(), places.end(), 0) : UpperMedian(std::move(places));
}

/// A place of the board shows the lens along one way through the image: as many terms as places can be told apart. Lenses of up
/// to four terms are compared however few there are.
bool MayBeDetermined(const LensConfig& config, const LensPool& pool) {
  constexpr int kAlwaysCompared = 4;
  if (config.model == LensModel::kSplined) return true;  // asks for many corners
  const int terms = geometry::NumDistortionParams(config.model);
  return terms <= kAlwaysCompared || terms <= PlacesOf(pool, config.shared);
}

/// Models worth comparing for the field of view and the number of corners.
std::vector<LensConfig> Models(const LensPool& pool, bool few) {
  const double angle = LargestAngleOf(pool);
  std::vector<LensConfig> models;
  const auto add = [&](std::initializer_list<LensModel> list) {
    for (LensModel model : list) models.push_back({model, {}, false, false});
  };
  if (angle < kVeryWideRad) {
    add({LensModel::kPinhole, LensModel::kBrown1, LensModel::kBrown2, LensModel::kBrown4});
    if (!few) add({LensModel::kBrown5, LensModel::kRational8, LensModel::kThinPrism12});
  }
  if (angle > kWideRad) {
    add({LensModel::kUcm, LensModel::kEucm, LensModel::kDoubleSphere, LensModel::kKannalaBrandt4});
    if (!few) add({LensModel::kUcmP, LensModel::kEucmP, LensModel::kDoubleSphereP, LensModel::kKannalaBrandt4P});
  }
  if (!few && angle > kWideRad && LargestIndependentCorners(pool) >= kMinSplineCorners) {
    for (const LensConfig& config : SplinedConfigs(pool)) models.push_back(config);
  }
  return models;
}

}  // namespace

int LargestNumCorners(const LensPool& pool) {
  std::vector<int> corners(pool.state.cameras.size(), 0);
  for (const View& view : pool.views) corners[view.camera_idx] += static_cast<int>((view.weights.array() > 0).count());
  return *std::max_element(corners.begin(), corners.end());
}

std::vector<int> ClustersOfCameras(const LensPool& pool) {
  std::vector<std::vector<int>> clusters(pool.state.cameras.size());
  for (size_t v = 0; v < pool.views.size(); ++v) clusters[pool.views[v].camera_idx].push_back(pool.cluster[v]);
  std::vector<int> counts;
  for (const std::vector<int>& own : clusters) counts.push_back(CountClusters(own));
  return counts;
}

std::vector<LensConfig> Configurations(const LensPool& pool, const SelectionOptions& options, bool few) {
  const int cameras = static_cast<int>(pool.state.cameras.size());
  std::vector<LensConfig> configs = options.only;
  for (LensConfig& config : configs) config.warp = options.warp, config.stretch = options.stretch;
  if (!configs.empty()) return configs;
  const auto add = [&](const LensConfig& config) {
    if (!options.models.empty() || MayBeDetermined(config, pool)) configs.push_back(config);
  };
  for (LensConfig config : options.models.empty() ? Models(pool, few) : options.models) {
    config.warp = options.warp, config.stretch = options.stretch;
    if (options.separate || cameras == 1) add(config);
    config.shared = true;
    if (options.sharing && cameras > 1) add(config);
  }
  std::stable_sort(configs.begin(), configs.end(), [&](const LensConfig& a, const LensConfig& b) {
    return NumLensParams(a, cameras) < NumLensParams(b, cameras);
  });
  return configs;
}

std::vector<LensConfig> SplinedConfigs(const LensPool& pool) {
  constexpr double kMargin = 1.05;
  const geometry::Camera& camera = pool.state.cameras[0];
  const double aspect = static_cast<double>(camera.height_px) / camera.width_px;
  const int field_deg = std::clamp(static_cast<int>(std::ceil(2 * kMargin * LargestAngleOf(pool) * 180 / M_PI)), 30, 300);
  std::vector<LensConfig> configs;
  for (int cols : {8, 11, 16}) {
    const int rows = std::max(5, static_cast<int>(std::lround(cols * aspect)));
    configs.push_back({LensModel::kSplined, {3, cols, rows, field_deg}, false, false});
  }
  return configs;
}

}  // namespace mvstudio::calib
