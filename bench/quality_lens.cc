#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "bench/quality.h"
#include "geometry/lens/camera.h"

namespace mvstudio::bench {
namespace {

using geometry::Camera;

Camera MakeCamera(geometry::LensModel model, std::initializer_list<double> distortion) {
  Camera camera = geometry::MakePinhole("bench", 1920, 1080, 1000);
  camera.model = model;
  Eigen::VectorXd params(4 + distortion.size());
  params.head<4>() = camera.params;
  int i = 4;
  for (double k : distortion) params[i++] = k;
  camera.params = params;
  return camera;
}

std::vector<Eigen::Vector2d> Grid(const Camera& camera) {
  std::vector<Eigen::Vector2d> pixels;
  for (int y = 0; y < camera.height_px; y += 20) {
    for (int x = 0; x < camera.width_px; x += 20) pixels.emplace_back(x, y);
  }
  return pixels;
}

/// OpenCV wants 4, 5 or 8 coefficients; the missing ones are zero.
std::vector<double> OpenCvDistortion(const Camera& camera) {
  std::vector<double> k(camera.params.data() + 4, camera.params.data() + camera.params.size());
  k.resize(std::max<size_t>(k.size(), 4));
  return k;
}

/// Distance in px after undistorting and distorting again.
double RoundTripError(const Camera& camera, const Eigen::Vector3d& ray, const Eigen::Vector2d& px) {
  // By OpenCV's own formula, not by the projector under test, which refuses points beyond the valid radius.
  const std::vector<double> k = OpenCvDistortion(camera);
  std::vector<cv::Point2d> projected;
  const cv::Matx33d matrix(camera.fx(), 0, camera.cx(), 0, camera.fy(), camera.cy(), 0, 0, 1);
  cv::projectPoints(std::vector<cv::Point3d>{{ray[0] / ray[2], ray[1] / ray[2], 1}}, cv::Vec3d(), cv::Vec3d(), matrix, k,
                    projected);
  return std::hypot(projected[0].x - px[0], projected[0].y - px[1]);
}

Row Ours(const std::string& problem, const Camera& camera) {
  const auto pixels = Grid(camera);
  std::vector<geometry::Unprojection> rays(pixels.size());
  const Stopwatch watch;
  const geometry::Projector projector(camera);
  for (size_t i = 0; i < pixels.size(); ++i) rays[i] = projector.Unproject(pixels[i]);
  const double seconds = watch.Seconds();
  std::vector<double> errors(pixels.size(), NAN);
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (rays[i].status == Status::kOk) errors[i] = RoundTripError(camera, rays[i].ray_in_cam, pixels[i]);
  }
  return MakeRow(problem, "mvstudio", "px", errors, seconds);
}

Row OpenCv(const std::string& problem, const Camera& camera, int iterations) {
  const auto pixels = Grid(camera);
  std::vector<cv::Point2d> in, out;
  for (const auto& px : pixels) in.emplace_back(px[0], px[1]);
  const std::vector<double> k = OpenCvDistortion(camera);
  const cv::Matx33d matrix(camera.fx(), 0, camera.cx(), 0, camera.fy(), camera.cy(), 0, 0, 1);
  const Stopwatch watch;
  if (iterations == 0) {
    cv::undistortPoints(in, out, matrix, k);
  } else {
    const cv::TermCriteria stop(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, iterations, 1e-12);
    cv::undistortPoints(in, out, matrix, k, cv::noArray(), cv::noArray(), stop);
  }
  const double seconds = watch.Seconds();
  std::vector<double> errors;
  for (size_t i = 0; i < pixels.size(); ++i) errors.push_back(RoundTripError(camera, {out[i].x, out[i].y, 1}, pixels[i]));
  return MakeRow(problem, iterations ? "OpenCV, 1000 iterations" : "OpenCV, defaults", "px", errors, seconds);
}

}  // namespace

std::vector<Row> BenchLens(uint64_t) {
  using geometry::LensModel;
  const std::pair<std::string, Camera> problems[] = {
      {"undistort, k1 -0.1 k2 0.01", MakeCamera(LensModel::kBrown2, {-0.1, 0.01})},
      {"undistort, -0.3 0.1 1e-3 -1e-3", MakeCamera(LensModel::kBrown4, {-0.3, 0.1, 1e-3, -1e-3})},
      {"undistort, k1 +0.5", MakeCamera(LensModel::kBrown2, {0.5, 0.0})},
      {"undistort, folds: -0.35 0.15 0 0 -0.03", MakeCamera(LensModel::kBrown5, {-0.35, 0.15, 0, 0, -0.03})},
  };
  std::vector<Row> rows;
  for (const auto& [name, camera] : problems) {
    rows.push_back(Ours(name, camera));
    rows.push_back(OpenCv(name, camera, 0));
    rows.push_back(OpenCv(name, camera, 1000));
  }
  return rows;
}

}  // namespace mvstudio::bench
