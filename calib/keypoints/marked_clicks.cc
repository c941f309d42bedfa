#include "calib/keypoints/marked_clicks.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>
#include <set>

#include "core/error.h"
#include "core/random.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr size_t kFewestCommon = 6, kFewestInliers = 5;

struct Common {
  std::vector<Eigen::Vector3d> in_a, in_b;
  double sigma_rad = 0;
};

/// Cost of the rays' distance from their epipolar planes; a point that is behind a camera, or off, costs 9.
void Judge(const Common& common, RelativeStart* seed) {
  constexpr double kMost = 9;
  seed->cost = 0;
  std::vector<double> sines;
  for (size_t i = 0; i < common.in_a.size(); ++i) {
    const Eigen::Vector3d rotated = seed->b_from_a.rotation * common.in_a[i], &ray = common.in_b[i];
    const Eigen::Vector3d normal = seed->b_from_a.translation.cross(rotated);
    const double off = normal.norm() > 0 ? ray.dot(normal) / normal.norm() / common.sigma_rad : 10;
    // Depths that bring both rays closest to each other: depth_a turned + t = depth_b ray.
    const double dot = rotated.dot(ray), sine2 = 1 - dot * dot;
    const double along_a = rotated.dot(seed->b_from_a.translation), along_b = ray.dot(seed->b_from_a.translation);
    const bool before = sine2 > 0 && dot * along_b - along_a > 0 && along_b - dot * along_a > 0;
    const double cost = before ? std::min(off * off, kMost) : kMost;
    seed->cost += cost;
    if (cost < kMost) sines.push_back(std::sqrt(sine2));
  }
  const auto inliers = static_cast<double>(sines.size());
  seed->score = inliers >= kFewestInliers ? inliers * std::min(0.5, UpperMedian(std::move(sines), 0)) : 0;
}

/// The four relative poses of an essential matrix.
std::vector<Rigid3> PosesOf(const Eigen::Matrix3d& essential) {
  std::vector<Rigid3> poses;
  if (!essential.allFinite()) return poses;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV(), w;
  if (u.determinant() < 0) u = -u;
  if (v.determinant() < 0) v = -v;
  w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  for (const Eigen::Matrix3d& turn : {w, Eigen::Matrix3d(w.transpose())}) {
    for (const double sign : {1.0, -1.0}) {
      Rigid3 pose;
      pose.rotation = Eigen::Quaterniond(Eigen::Matrix3d(u * turn * v.transpose())).normalized();
      pose.translation = sign * u.col(2);
      poses.push_back(pose);
    }
  }
  return poses;
}

bool Alike(const Rigid3& a, const Rigid3& b) {
  constexpr double kRad = 0.05;
  return a.rotation.angularDistance(b.rotation) < kRad && (a.translation - b.translation).norm() < kRad;
}

/// Adds a start unless one alike is there, which keeps the cheaper of both.
void Keep(const RelativeStart& seed, std::vector<RelativeStart>* seeds) {
  constexpr size_t kMost = 6;
  for (RelativeStart& other : *seeds) {
    if (!Alike(other.b_from_a, seed.b_from_a)) continue;
    if (seed.cost < other.cost) other = seed;
    return;
  }
  seeds->push_back(seed);
  std::sort(seeds->begin(), seeds->end(), [](const RelativeStart& x, const RelativeStart& y) { return x.cost < y.cost; });
  if (seeds->size() > kMost) seeds->pop_back();
}

std::vector<RelativeStart> SeedsOf(const MarkedClicks& clicked, size_t a, size_t b) {
  constexpr int kSamples = 400, kSampleSize = 5;
  Common common;
  common.sigma_rad = std::max(clicked.sigma_rad[a], clicked.sigma_rad[b]);
  for (const auto& [point, observation] : clicked.observations[a]) {
    const auto other = clicked.observations[b].find(point);
    if (other != clicked.observations[b].end())
      common.in_a.push_back(observation.ray), common.in_b.push_back(other->second.ray);
  }
  std::vector<RelativeStart> seeds;
  if (common.in_a.size() < kFewestCommon) return seeds;
  const opengv::bearingVectors_t in_a(common.in_a.begin(), common.in_a.end()), in_b(common.in_b.begin(), common.in_b.end());
  const opengv::relative_pose::CentralRelativeAdapter adapter(in_a, in_b);
  Rng rng(1);
  for (int i = 0; i < kSamples; ++i) {
    std::set<int> chosen;
    while (chosen.size() < kSampleSize) chosen.insert(static_cast<int>(rng.Uniform(0, static_cast<double>(in_a.size()))));
    const std::vector<int> sample(chosen.begin(), chosen.end());
    for (const auto& essential : opengv::relative_pose::fivept_nister(adapter, sample)) {
      for (const Eigen::Matrix3d& e : {Eigen::Matrix3d(essential), Eigen::Matrix3d(essential.transpose())}) {
        for (const Rigid3& pose : PosesOf(e)) {
          RelativeStart seed{a, b, pose, 0, 0};
          Judge(common, &seed);
          if (seed.score > 0) Keep(seed, &seeds);
        }
      }
    }
  }
  return seeds;
}

}  // namespace

MarkedClicks ClicksOf(const geometry::Rig& lenses, const ScenePoints& marks, double sigma_px) {
  for (const std::string& name : marks.cameras)
    if (lenses.Find(name) < 0)
      throw UsageError("option 'scene-points' names the camera '" + name + "', which the calibration of the lenses lacks");
  MarkedClicks clicked;
  clicked.sigma_px = sigma_px;
  for (const geometry::RigCamera& camera : lenses.cameras) {
    const auto found = std::find(marks.cameras.begin(), marks.cameras.end(), camera.camera.name);
    if (found == marks.cameras.end()) continue;
    clicked.rig.cameras.push_back({camera.camera, Rigid3(), camera.params_covariance, std::nullopt});
    clicked.sigma_rad.push_back(sigma_px / (0.5 * (camera.camera.fx() + camera.camera.fy())));
    const geometry::Projector projector(camera.camera);
    std::map<int, MarkObservation>& own = clicked.observations.emplace_back();
    for (const PointClick& click : marks.clicks) {
      if (click.camera_idx != found - marks.cameras.begin()) continue;
      const geometry::Unprojection ray = projector.Unproject(click.px);
      if (ray.status == Status::kOk) own[click.point_idx] = {click.px, ray.ray_in_cam.normalized()};
    }
  }
  return clicked;
}

std::vector<RelativeStart> RelativeStarts(const MarkedClicks& clicked) {
  std::vector<RelativeStart> seeds;
  for (size_t a = 0; a < clicked.observations.size(); ++a) {
    for (size_t b = a + 1; b < clicked.observations.size(); ++b) {
      const std::vector<RelativeStart> own = SeedsOf(clicked, a, b);
      seeds.insert(seeds.end(), own.begin(), own.end());
    }
  }
  std::sort(seeds.begin(), seeds.end(), [](const RelativeStart& x, const RelativeStart& y) { return x.score > y.score; });
  return seeds;
}

}  // namespace mvstudio::calib
