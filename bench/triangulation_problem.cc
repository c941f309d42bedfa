#include <Eigen/Geometry>
#include <cmath>

#include "bench/triangulation.h"
#include "core/random.h"
#include "core/units.h"

namespace mvstudio::bench {
namespace {

constexpr int kWidth = 1920, kHeight = 1080;

geometry::RigCamera MakeCamera(int index, int views, bool distorted) {
  const double angle = 2 * kPi * index / std::max(views, 3);
  const Eigen::Vector3d center(3 * std::cos(angle), 3 * std::sin(angle), index % 2 ? 1.2 : 0.2);
  Eigen::Matrix3d cam_from_world;
  const Eigen::Vector3d z = -center.normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  cam_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam" + std::to_string(index), kWidth, kHeight, 1500);
  if (distorted) {
    const Eigen::Vector4d axis = camera.camera.params;
    camera.camera.model = geometry::LensModel::kBrown5;
    camera.camera.params.resize(9);
    camera.camera.params << axis, -0.28, 0.2, 3e-4, -5e-4, 0.02;
  }
  camera.cam_from_world.rotation = Eigen::Quaterniond(cam_from_world).normalized();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center);
  return camera;
}

}  // namespace

TriangulationProblem MakeTriangulationProblem(const std::string& name, int views, int64_t points, bool distorted, int num_wrong,
                                              uint64_t seed) {
  TriangulationProblem problem;
  problem.name = name;
  problem.batch = triangulate::MakeBatch(views, points);
  std::vector<geometry::Projector> projectors;
  for (int c = 0; c < views; ++c) {
    problem.rig.cameras.push_back(MakeCamera(c, views, distorted));
    projectors.emplace_back(problem.rig.cameras.back().camera);
  }
  Rng rng(seed);
  for (int64_t i = 0; i < points; ++i) {
    const Eigen::Vector3d x(rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5));
    problem.truth.push_back(x);
    const int first_wrong = static_cast<int>(rng.Index(views));
    for (int c = 0; c < views; ++c) {
      Eigen::Vector2d px = projectors[c].Project(problem.rig.cameras[c].cam_from_world * x).px;
      px += Eigen::Vector2d(rng.Normal(), rng.Normal());
      const bool wrong =
          num_wrong > 0 && (c - first_wrong + views) % views % 3 == 0 && (c - first_wrong + views) % views / 3 < num_wrong;
      if (wrong) px = {rng.Uniform(0, kWidth - 1), rng.Uniform(0, kHeight - 1)};
      problem.batch.x_px[c * points + i] = px.x();
      problem.batch.y_px[c * points + i] = px.y();
    }
  }
  return problem;
}

}  // namespace mvstudio::bench
