#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/ccalib/omnidir.hpp>
#include <vector>

#include "core/random.h"
#include "core/units.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

/// OpenCV projects the same points through the same parameters.
namespace mvstudio::geometry {
namespace {

std::vector<cv::Point3d> RandomPoints(const Camera& camera, int count) {
  Rng rng(31);
  std::vector<cv::Point3d> points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d x =
        testing::Direction(camera.model, rng.Uniform(0.01, testing::Reach(camera)), rng.Uniform(0, 2 * kPi)) *
        rng.Uniform(0.3, 5);
    points.emplace_back(x[0], x[1], x[2]);
  }
  return points;
}

void ExpectSame(const Camera& camera, const std::vector<cv::Point3d>& points, const std::vector<cv::Point2d>& px) {
  ASSERT_EQ(points.size(), px.size());
  for (size_t i = 0; i < points.size(); ++i) {
    const Projection own = Project(camera, {points[i].x, points[i].y, points[i].z});
    ASSERT_EQ(own.status, Status::kOk) << camera.name;
    ASSERT_LT((own.px - Eigen::Vector2d(px[i].x, px[i].y)).norm(), 1e-9) << camera.name;
  }
}

cv::Mat K(const Camera& camera) {
  return (cv::Mat_<double>(3, 3) << camera.fx(), 0, camera.cx(), 0, camera.fy(), camera.cy(), 0, 0, 1);
}

TEST(OpenCvOracle, PerspectiveModels) {
  const cv::Vec3d zero(0, 0, 0);
  for (const LensModel model : {LensModel::kBrown4, LensModel::kBrown5, LensModel::kRational8, LensModel::kThinPrism12}) {
    const Camera camera = testing::OrdinaryLenses()[static_cast<size_t>(model)];
    const std::vector<cv::Point3d> points = RandomPoints(camera, 200);
    const cv::Mat distortion(1, static_cast<int>(camera.params.size()) - 4, CV_64F,
                             const_cast<double*>(camera.params.data() + 4));
    std::vector<cv::Point2d> px;
    cv::projectPoints(points, zero, zero, K(camera), distortion, px);
    ExpectSame(camera, points, px);
  }
}

TEST(OpenCvOracle, Fisheye) {
  Camera camera = testing::OrdinaryLenses()[static_cast<size_t>(LensModel::kKannalaBrandt4)];
  std::vector<cv::Point3d> points = RandomPoints(camera, 200);
  // OpenCV divides by z.
  for (cv::Point3d& p : points) p.z = std::abs(p.z) + 0.1;
  std::vector<cv::Point2d> px;
  const cv::Vec3d zero(0, 0, 0);
  cv::fisheye::projectPoints(points, px, zero, zero, K(camera), cv::Mat(1, 4, CV_64F, camera.params.data() + 4));
  ExpectSame(camera, points, px);
}

TEST(OpenCvOracle, OmnidirWithoutRadialTerms) {
  for (const Camera& camera : {testing::MakeLens(LensModel::kUcmP, {1.2, 0.003, -0.002}),
                               testing::MakeLens(LensModel::kUcmP, {0.8, -0.004, 0.001}, 1280, 960, 500)}) {
    const std::vector<cv::Point3d> points = RandomPoints(camera, 200);
    std::vector<cv::Point2d> px;
    const cv::Vec3d zero(0, 0, 0);
    const cv::Mat distortion = (cv::Mat_<double>(1, 4) << 0, 0, camera.params[5], camera.params[6]);
    cv::omnidir::projectPoints(points, px, zero, zero, K(camera), camera.params[4], distortion);
    ExpectSame(camera, points, px);
  }
}

}  // namespace
}  // namespace mvstudio::geometry
