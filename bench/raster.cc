#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "avatar/body/mesh_raster.h"
#include "tests/body/plain_z_buffer.h"

/// Parts and coordinates of a body in an image beside a z-buffer without tricks: seconds, and pixels that differ.
namespace mvstudio::body {
namespace {

template <class Work>
double Milliseconds(int repeats, const Work& work) {
  double least = 1e300;
  for (int i = 0; i < repeats; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    work();
    least = std::min(least, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  }
  return least;
}

/// The whole body from the front, from 3 m.
geometry::RigCamera CameraOf(int size_px) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", size_px, size_px, 1.5 * size_px);
  camera.cam_from_world.rotation = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX());
  camera.cam_from_world.translation = Eigen::Vector3d(0, 0.9, 3);
  return camera;
}

void PrintRow(const BodyTemplate& body, int size_px, int repeats) {
  const geometry::RigCamera camera = CameraOf(size_px);
  PartUvMap map;
  std::vector<PlainPixel> plain;
  const double ours_ms = Milliseconds(repeats, [&] { map = RasterizeBody(body, body.vertices, camera); });
  const double plain_ms = Milliseconds(repeats, [&] { plain = PlainZBuffer(body, body.vertices, camera); });
  int seen = 0, unsure = 0, other = 0;
  double depth_mm = 0;
  for (size_t p = 0; p < plain.size(); ++p) {
    const int part = plain[p].face < 0 ? 0 : body.face_part[static_cast<size_t>(plain[p].face)];
    seen += part > 0;
    if (!plain[p].IsSure()) {
      ++unsure;
      continue;
    }
    other += map.part[p] != part;
    if (part > 0 && map.part[p] == part) depth_mm = std::max(depth_mm, 1e3 * std::abs(map.depth_m[p] - plain[p].depth_m));
  }
  std::printf("%8d %8d %10d %10.2f %10.2f %8.1f %9d %9d %12.1e\n", static_cast<int>(body.faces.cols()), size_px, seen, ours_ms,
              plain_ms, plain_ms / ours_ms, unsure, other, depth_mm);
}

}  // namespace
}  // namespace mvstudio::body

int main(int argc, char** argv) {
  const int repeats = argc > 1 ? std::max(1, std::atoi(argv[1])) : 5;
  std::printf("%8s %8s %10s %10s %10s %8s %9s %9s %12s\n", "faces", "size px", "body px", "ours ms", "plain ms", "ratio",
              "near edge", "other", "depth off mm");
  for (const double detail : {0.5, 1.0, 2.0}) {
    const mvstudio::body::BodyTemplate body = mvstudio::body::MakeMannequin(1.75, detail);
    for (const int size_px : {96, 384, 1536}) mvstudio::body::PrintRow(body, size_px, repeats);
  }
  return 0;
}
