// The calls of the Python module as a C++ program makes them; bench/python_beside_cpp.py times both in turns.
// Requests: "project CALIBRATION POINTS THREADS", "triangulate CALIBRATION POINTS THREADS".
#include <Eigen/Core>
#include <algorithm>
#include <cstdint>

#include "bench/requests.h"
#include "core/parallel.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig_io.h"
#include "triangulate/batch/batch.h"

namespace {

using namespace mvstudio;

/// In [0, 1), the same here and in the script.
double Part(int64_t i, int64_t stride) { return static_cast<double>((i * stride + 12345) % 1000003) / 1000003.0; }

/// (3, N) metres in world, about the origin.
Eigen::Matrix3Xd Points(int64_t n) {
  Eigen::Matrix3Xd x(3, n);
  for (int64_t i = 0; i < n; ++i) x.col(i) << Part(i, 7919) - 0.5, Part(i, 104729) - 0.5, Part(i, 1299709) - 0.5;
  return x;
}

void ForPieces(int64_t count, int threads, const std::function<void(int64_t, int64_t)>& body) {
  constexpr int64_t kPiece = 8192;
  ParallelFor((count + kPiece - 1) / kPiece, ResolveThreads(threads),
              [&](int64_t i) { body(i * kPiece, std::min(count, (i + 1) * kPiece)); });
}

/// (2, N) px of points in world.
Eigen::Matrix2Xd Projected(const geometry::RigCamera& camera, const Eigen::Matrix3Xd& x, int threads) {
  const geometry::Projector projector(camera.camera);
  const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
  const Eigen::Vector3d translation = camera.cam_from_world.translation;
  Eigen::Matrix2Xd px(2, x.cols());
  ForPieces(x.cols(), threads, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) px.col(i) = projector.Project(rotation * x.col(i) + translation).px;
  });
  return px;
}

void TimeProject(std::istringstream& words) {
  const geometry::Rig rig = geometry::ReadRig(bench::Word(words));
  static Eigen::Matrix3Xd x;  // made once
  const int n = bench::Number(words), threads = bench::Number(words);
  if (x.cols() != n) x = Points(n);
  double sum = 0;
  Eigen::Matrix2Xd px;
  bench::PrintTimed([&] {
    px = Projected(rig.cameras[0], x, threads);
    return px(0, n - 1);
  });
  sum = px.sum();
  std::printf("%.17g\n", sum);
}

/// Every view of `points` in the rig, off by half a pixel at most.
triangulate::PointBatch Views(const geometry::Rig& rig, const Eigen::Matrix3Xd& points) {
  triangulate::PointBatch batch = triangulate::MakeBatch(static_cast<int>(rig.cameras.size()), points.cols());
  for (int c = 0; c < batch.num_cameras; ++c) {
    const Eigen::Matrix2Xd px = Projected(rig.cameras[static_cast<size_t>(c)], points, 1);
    for (int64_t i = 0; i < batch.num_points; ++i) {
      const auto at = static_cast<size_t>(c * batch.num_points + i);
      batch.x_px[at] = px(0, i) + Part(i + c, 15485863) - 0.5, batch.y_px[at] = px(1, i) + Part(i + c, 32452843) - 0.5;
    }
  }
  return batch;
}

void TimeTriangulate(std::istringstream& words) {
  const geometry::Rig rig = geometry::ReadRig(bench::Word(words));
  const int n = bench::Number(words), threads = bench::Number(words);
  const triangulate::PointBatch batch = Views(rig, Points(n));
  triangulate::BatchResult result;
  bench::PrintTimed([&] {
    RunContext run;
    run.num_threads = threads;
    result = triangulate::TriangulateBatch(triangulate::Prepare(rig), batch, {}, run);
    return result.x.back();
  });
  double sum = 0;
  for (const double x_m : result.x) sum += x_m;
  std::printf("%.17g\n", sum);
}

}  // namespace

int main() { return mvstudio::bench::Answer("python_calls", {{"project", TimeProject}, {"triangulate", TimeTriangulate}}); }
