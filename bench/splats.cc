// Gaussians on a body: images and training steps a second against their number, the pixels and the threads.
//
// Usage: bench_splats [SECONDS_EACH]. Prints a table.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "avatar/splats/render.h"
#include "avatar/splats/train/adam.h"
#include "avatar/splats/train/initial.h"
#include "avatar/splats/train/train_step.h"
#include "core/stopwatch.h"

namespace mvstudio {
namespace {

/// Calls a second, over at least `seconds`.
template <class Work>
double Rate(double seconds, const Work& work) {
  work();
  const Stopwatch watch;
  int64_t calls = 0;
  double passed = 0;
  while (passed < seconds) {
    work();
    ++calls;
    passed = watch.Seconds();
  }
  return static_cast<double>(calls) / passed;
}

geometry::RigCamera CameraOf(int size_px) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("bench", size_px, size_px, 1.5 * size_px);
  Eigen::Matrix3d cam_from_world;
  cam_from_world << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // from before the person
  camera.cam_from_world = {Eigen::Quaterniond(cam_from_world), -cam_from_world * Eigen::Vector3d(0, -2.8, 0.9)};
  return camera;
}

void Row(const body::BodyTemplate& body, const body::Textures& textures, int64_t count, int size_px, double seconds) {
  splats::Cloud cloud = splats::CoverBody(body, textures, count, 0, 1);
  splats::TrainView view;
  view.camera = CameraOf(size_px);
  view.vertices = std::make_shared<const Eigen::Matrix3Xf>(body.vertices);
  const body::RenderedBody rendered = body::RenderBody(body, textures, body.vertices, view.camera);
  view.image = rendered.image, view.mask = rendered.cover;
  splats::SetFilters(splats::PixelSizes(cloud, body.faces, {splats::ViewOf<float>(view.camera)}, {view.vertices.get()}, 1),
                     &cloud);
  double images[2], steps[2];
  for (const int threads : {1, 2}) {
    images[threads - 1] = Rate(seconds, [&] {
      splats::RenderGaussians(cloud, body, body.vertices, view.camera, {true, threads});
    });
    splats::AdamState adam = splats::MakeAdam(cloud.size(), 0);
    splats::Cloud learned = cloud;
    steps[threads - 1] = Rate(seconds, [&] {
      const splats::BatchResult step = splats::BatchGradient(learned, body.faces, {&view, &view}, {}, {}, true, threads);
      splats::AdamStep(step.gradient, {}, 1, &adam, &learned.values);
    });
  }
  std::printf("%9lld %6d %13.1f %13.1f %13.1f %13.1f\n", static_cast<long long>(count), size_px, images[0], images[1], steps[0],
              steps[1]);
}

}  // namespace
}  // namespace mvstudio

int main(int argc, char** argv) {
  using namespace mvstudio;
  const double seconds = argc > 1 ? std::atof(argv[1]) : 1.0;
  const body::BodyTemplate body = body::MakeMannequin();
  const body::Textures textures = body::MannequinTextures(64, 1);
  std::printf("%9s %6s %13s %13s %13s %13s\n", "Gaussians", "px", "pictures/s 1", "pictures/s 2", "steps/s 1", "steps/s 2");
  for (const int size_px : {96, 256, 512})
    for (const int64_t count : {5000, 10000, 20000, 40000}) Row(body, textures, count, size_px, seconds);
  return 0;
}
