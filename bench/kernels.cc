#include <benchmark/benchmark.h>

#include <iterator>

#include "geometry/lens/camera.h"
#include "geometry/lens/lens_derivatives.h"

namespace mvstudio {
namespace {

constexpr int kNumModels = static_cast<int>(std::size(geometry::kAllLensModels));

geometry::Camera MakeCamera(geometry::LensModel model) {
  geometry::Camera camera = geometry::MakePinhole("bench", 640, 480, 550);
  camera.model = model;
  if (model == geometry::LensModel::kSplined) camera.spline = {3, 16, 12, 120};
  Eigen::VectorXd params = Eigen::VectorXd::Zero(geometry::NumParams(camera));
  params.head<4>() = camera.params;
  for (int i = 4; i < params.size(); ++i) params[i] = i % 2 ? 0.01 : -0.02;
  const geometry::LensTraits& traits = geometry::TraitsOf(model);
  for (int i = 0; i < traits.num_params; ++i) params[4 + i] = traits.params[i].ordinary;
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

void BM_ProjectLens(benchmark::State& state) {
  const geometry::Camera camera = MakeCamera(geometry::kAllLensModels[state.range(0)]);
  geometry::LensDerivatives derivatives;
  Eigen::Vector2d px;
  for (auto _ : state) {
    benchmark::DoNotOptimize(geometry::ProjectLens(camera, {0.3, -0.2, 2.0}, &px, &derivatives));
    benchmark::ClobberMemory();
  }
}

BENCHMARK(BM_ProjectLens)->DenseRange(0, kNumModels - 1);
BENCHMARK(BM_Project)->DenseRange(0, kNumModels - 1);
BENCHMARK(BM_ProjectWithJacobians)->DenseRange(0, kNumModels - 1);
BENCHMARK(BM_Unproject)->DenseRange(0, kNumModels - 1);

}  // namespace
}  // namespace mvstudio
