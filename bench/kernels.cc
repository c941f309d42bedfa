#include <benchmark/benchmark.h>

#include "geometry/camera.h"

namespace mvstudio {
namespace {

geometry::Camera MakeCamera(geometry::LensModel model) {
  geometry::Camera camera = geometry::MakePinhole("bench", 640, 480, 550);
  camera.model = model;
  Eigen::VectorXd params = Eigen::VectorXd::Zero(geometry::NumParams(model));
  params.head<4>() = camera.params;
  for (int i = 4; i < params.size(); ++i) params[i] = i % 2 ? 0.01 : -0.02;
  camera.params = params;
  return camera;
}

void BM_Project(benchmark::State& state) {
  const geometry::Projector projector(MakeCamera(geometry::kAllLensModels[state.range(0)]));
  for (auto _ : state) benchmark::DoNotOptimize(projector.Project({0.3, -0.2, 2.0}));
}

void BM_ProjectWithJacobians(benchmark::State& state) {
  const geometry::Projector projector(MakeCamera(geometry::kAllLensModels[state.range(0)]));
  for (auto _ : state) benchmark::DoNotOptimize(projector.ProjectWithJacobians({0.3, -0.2, 2.0}));
}

void BM_Unproject(benchmark::State& state) {
  const geometry::Projector projector(MakeCamera(geometry::kAllLensModels[state.range(0)]));
  for (auto _ : state) benchmark::DoNotOptimize(projector.Unproject({100.0, 90.0}));
}

BENCHMARK(BM_Project)->DenseRange(0, 6);
BENCHMARK(BM_ProjectWithJacobians)->DenseRange(0, 6);
BENCHMARK(BM_Unproject)->DenseRange(0, 6);

}  // namespace
}  // namespace mvstudio
