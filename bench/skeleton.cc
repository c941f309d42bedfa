// `triangulate --refine` on takes of growing length:
//   bench_skeleton [SEED] [OUT.json or -] [LARGEST NUMBER OF FRAMES] [SKELETON] [THREADS]
// A figure moves in front of six cameras, with noise and gaps; each combination of terms is forced on, the others are off.
// Choosing the weights takes the same time for all lengths and is part of the figures.

#include "geometry/skeleton/skeleton.h"

#include <sys/resource.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "bench/triangulation.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/stopwatch.h"
#include "triangulate/point/point.h"
#include "triangulate/skeleton/refine.h"

namespace mvstudio::bench {
namespace {

using triangulate::Observation;

/// Every joint at a fixed distance from the one before it in the skeleton, in a direction that swings.
std::vector<Eigen::Vector3d> Pose(const geometry::Skeleton& skeleton, int frame) {
  const double t = frame / 30.0;
  std::vector<Eigen::Vector3d> x(skeleton.joints.size(), {0.4 * std::sin(0.3 * t), 0.4 * std::cos(0.23 * t), 0});
  std::vector<bool> placed(x.size(), false);
  placed[0] = true;
  for (size_t pass = 0; pass < skeleton.bones.size(); ++pass) {
    for (size_t k = 0; k < skeleton.bones.size(); ++k) {
      auto [a, b] = skeleton.bones[k];
      if (placed[static_cast<size_t>(a)] == placed[static_cast<size_t>(b)]) continue;
      if (!placed[static_cast<size_t>(a)]) std::swap(a, b);
      const double phase = 2.4 * static_cast<double>(k), turn = phase + 0.7 * std::sin(1.9 * t + phase);
      const double rise = 0.5 * std::sin(2.7 * t - phase), length = 0.06 + 0.01 * static_cast<double>(k % 12);
      x[static_cast<size_t>(b)] =
          x[static_cast<size_t>(a)] +
          length * Eigen::Vector3d(std::cos(turn) * std::cos(rise), std::sin(turn) * std::cos(rise), std::sin(rise));
      placed[static_cast<size_t>(b)] = true;
    }
  }
  return x;
}

/// 2 px of noise; each joint is unseen in 4 % of the stretches of 12 frames.
triangulate::TakeResult Film(const geometry::Rig& rig, const triangulate::PreparedRig& prepared,
                             const geometry::Skeleton& skeleton, int num_frames, uint64_t seed) {
  const size_t joints = skeleton.joints.size();
  triangulate::TakeResult take;
  take.num_persons = 1, take.sigma_px = 2;
  take.points.resize(static_cast<size_t>(num_frames) * joints);
  take.observations.resize(take.points.size());
  ParallelFor(num_frames, 0, [&](int64_t f) {
    Rng rng(seed + 1000003 * static_cast<uint64_t>(f));
    const std::vector<Eigen::Vector3d> pose = Pose(skeleton, static_cast<int>(f));
    for (size_t j = 0; j < joints; ++j) {
      std::vector<Observation> seen;
      const bool hidden = Rng(seed + 7919 * static_cast<uint64_t>(f / 12) + 31 * j).Uniform() < 0.04;
      for (size_t c = 0; c < rig.cameras.size() && !hidden; ++c) {
        const auto projection = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * pose[j]);
        if (projection.status != Status::kOk) continue;
        seen.push_back({static_cast<int>(c), projection.px + 2 * Eigen::Vector2d(rng.Normal(), rng.Normal()), 2, 1});
      }
      const size_t i = static_cast<size_t>(f) * joints + j;
      take.points[i] = {static_cast<int>(f), 0, static_cast<int>(j), TriangulatePoint(prepared, seen)};
      take.observations[i] = std::move(seen);
    }
  });
  return take;
}

struct Row {
  std::string terms;
  int frames = 0;
  double wall_s = 0, peak_mb = 0, limb_std_mm = 0;
};

Row Measure(const geometry::Rig& rig, const geometry::Skeleton& skeleton, int frames, unsigned terms, uint64_t seed,
            int threads) {
  const triangulate::PreparedRig prepared = triangulate::Prepare(rig);
  const triangulate::TakeResult take = Film(rig, prepared, skeleton, frames, seed);
  const auto on = [terms](unsigned bit) { return terms & bit ? AutoOnOff::kOn : AutoOnOff::kOff; };
  triangulate::SkeletonRefineOptions options;
  options.robust = on(1), options.smoothness = on(2), options.bone_lengths = on(4);
  RunContext run;
  run.num_threads = threads;
  const auto solve = [&prepared](const std::vector<Observation>& seen) { return TriangulatePoint(prepared, seen); };
  const Stopwatch watch;
  const auto refined = RefineSkeleton(prepared, take, skeleton.bones, solve, options, run);
  Row row;
  row.wall_s = watch.Seconds();
  row.frames = frames, row.limb_std_mm = refined.report.limb_std_after_mm;
  row.terms = std::string(terms & 1 ? "robust " : "") + (terms & 2 ? "smoothness " : "") + (terms & 4 ? "bone-lengths " : "");
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  row.peak_mb = static_cast<double>(usage.ru_maxrss) / 1024;
  return row;
}

int Main(int argc, char** argv) {
  const uint64_t seed = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1;
  const int largest = argc > 3 ? std::atoi(argv[3]) : 1000;
  const geometry::Skeleton skeleton = geometry::SkeletonByName(argc > 4 ? argv[4] : "body25");
  const geometry::Rig rig = MakeTriangulationProblem("ring", 6, 1, false, 0, seed).rig;
  nlohmann::json rows = nlohmann::json::array();
  std::printf("%7s %9s %9s %9s  %s\n", "frames", "s", "peak MB", "limbs mm", "terms");
  for (int frames = 100; frames <= largest; frames *= 10) {
    for (const unsigned terms : {1u, 2u, 4u, 6u, 7u}) {
      const Row row = Measure(rig, skeleton, frames, terms, seed, argc > 5 ? std::atoi(argv[5]) : 0);
      std::printf("%7d %9.2f %9.0f %9.2f  %s\n", row.frames, row.wall_s, row.peak_mb, row.limb_std_mm, row.terms.c_str());
      std::fflush(stdout);
      rows.push_back({{"frames", row.frames},
                      {"wall_s", row.wall_s},
                      {"peak_mb", row.peak_mb},
                      {"limb_std_mm", row.limb_std_mm},
                      {"terms", row.terms}});
    }
  }
  if (argc > 2 && std::string(argv[2]) != "-") std::ofstream(argv[2]) << rows.dump(1) << '\n';
  return 0;
}

}  // namespace
}  // namespace mvstudio::bench

int main(int argc, char** argv) { return mvstudio::bench::Main(argc, argv); }
