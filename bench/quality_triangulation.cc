#include <opencv2/calib3d.hpp>

#include "bench/quality.h"
#include "core/random.h"
#include "geometry/rig/rig.h"
#include "triangulate/point/point.h"

namespace mvstudio::bench {
namespace {

using geometry::Rig;

constexpr int kPoints = 2000;

/// A ring of pinhole cameras looking at the origin, the whole world moved by `offset_m` along x.
Rig MakeRing(int cameras, double radius_m, double spread_rad, double offset_m) {
  Rig rig;
  for (int i = 0; i < cameras; ++i) {
    const double angle = spread_rad * i / cameras;
    const Eigen::Vector3d center(radius_m * std::cos(angle), radius_m * std::sin(angle), 0.3 * (i % 3));
    Eigen::Matrix3d rows;
    rows.row(2) = -center.normalized();
    rows.row(0) = rows.row(2).cross(-Eigen::RowVector3d::UnitZ()).normalized() * -1.0;
    rows.row(1) = rows.row(2).cross(rows.row(0));
    geometry::RigCamera camera;
    camera.camera = geometry::MakePinhole("cam" + std::to_string(i), 640, 480, 550);
    camera.cam_from_world.rotation = Eigen::Quaterniond(rows).normalized();
    camera.cam_from_world.translation = -(camera.cam_from_world.rotation * (center + Eigen::Vector3d(offset_m, 0, 0)));
    rig.cameras.push_back(camera);
  }
  return rig;
}

struct Problem {
  std::string name;
  Rig rig;
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<triangulate::Observation>> observations;
};

/// Points in a ball of 0.5 m; `outliers` views of each are moved by 50 px.
Problem MakeProblem(const std::string& name, const Rig& rig, double offset_m, double noise_px, int outliers, uint64_t seed) {
  Problem problem{name, rig, {}, {}};
  Rng rng(seed);
  for (int i = 0; i < kPoints; ++i) {
    const Eigen::Vector3d x(offset_m + rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5), rng.Uniform(-0.5, 0.5));
    std::vector<triangulate::Observation> seen;
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      triangulate::Observation o;
      o.camera_idx = static_cast<int>(c);
      o.px = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x).px;
      o.px += noise_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
      if (static_cast<int>(c) < outliers) o.px += Eigen::Vector2d(50, -30);
      o.sigma_px = noise_px > 0 ? noise_px : 0.01;
      seen.push_back(o);
    }
    problem.points.push_back(x);
    problem.observations.push_back(seen);
  }
  return problem;
}

Row Ours(const Problem& problem, const std::string& name, triangulate::PointMethod method) {
  std::vector<triangulate::Point> found(problem.points.size());
  triangulate::PointOptions options;
  options.method = method;
  const Stopwatch watch;
  const triangulate::PreparedRig rig = triangulate::Prepare(problem.rig);
  for (size_t i = 0; i < found.size(); ++i) found[i] = TriangulatePoint(rig, problem.observations[i], options);
  const double seconds = watch.Seconds();
  std::vector<double> errors;
  for (size_t i = 0; i < found.size(); ++i) {
    errors.push_back(found[i].status == Status::kOk ? 1000 * (found[i].x_in_world - problem.points[i]).norm() : NAN);
  }
  return MakeRow(problem.name, name, "mm", errors, seconds);
}

/// OpenCV's two-view DLT on the first camera and one a quarter of the ring away.
Row OpenCv(const Problem& problem) {
  const size_t other = problem.rig.cameras.size() / 4;
  auto matrix = [&](size_t c) {
    const auto& camera = problem.rig.cameras[c];
    const Eigen::Matrix<double, 3, 4> p = camera.camera.K() * geometry::ToMatrix(camera.cam_from_world).topRows<3>();
    cv::Matx34d m;
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 4; ++k) m(r, k) = p(r, k);
    }
    return m;
  };
  std::vector<double> errors;
  const Stopwatch watch;
  const cv::Matx34d a = matrix(0), b = matrix(other);
  for (size_t i = 0; i < problem.points.size(); ++i) {
    const Eigen::Vector2d& u = problem.observations[i][0].px;
    const Eigen::Vector2d& v = problem.observations[i][other].px;
    cv::Mat x;
    cv::triangulatePoints(a, b, cv::Mat(cv::Vec2d(u[0], u[1])), cv::Mat(cv::Vec2d(v[0], v[1])), x);
    const cv::Vec4d h(x.ptr<double>());
    errors.push_back(1000 * (Eigen::Vector3d(h[0], h[1], h[2]) / h[3] - problem.points[i]).norm());
  }
  return MakeRow(problem.name, "OpenCV triangulatePoints, 2 views", "mm", errors, watch.Seconds());
}

}  // namespace

std::vector<Row> BenchTriangulation(uint64_t seed) {
  using triangulate::PointMethod;
  const Problem problems[] = {
      MakeProblem("8 cameras at 3 m, exact", MakeRing(8, 3, 6.283, 0), 0, 0, 0, seed),
      MakeProblem("the same, world origin 100 km away", MakeRing(8, 3, 6.283, 1e5), 1e5, 0, 0, seed),
      MakeProblem("8 cameras at 3 m, 1 px noise", MakeRing(8, 3, 6.283, 0), 0, 1, 0, seed),
      MakeProblem("the same, 2 of 8 views 58 px off", MakeRing(8, 3, 6.283, 0), 0, 1, 2, seed),
      MakeProblem("4 cameras within 20 deg, 1 px noise", MakeRing(4, 3, 0.35, 0), 0, 1, 0, seed),
  };
  std::vector<Row> rows;
  for (const Problem& problem : problems) {
    rows.push_back(Ours(problem, "mvstudio midpoint", PointMethod::kMidpoint));
    rows.push_back(Ours(problem, "mvstudio linear", PointMethod::kLinear));
    rows.push_back(Ours(problem, "mvstudio all views", PointMethod::kAllViews));
    rows.push_back(Ours(problem, "mvstudio robust", PointMethod::kRobust));
    rows.push_back(OpenCv(problem));
  }
  return rows;
}

}  // namespace mvstudio::bench
