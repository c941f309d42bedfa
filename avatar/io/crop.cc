#include "avatar/io/crop.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/check.h"

namespace mvstudio::avatar {
namespace {

constexpr double kMinDepthM = 0.1;
constexpr int kMaxSamples = 16;  // a side

// Metres from a joint to the body's surface, in the order of Panoptic's joints: head 0.16, hands 0.20, feet 0.18.
double Thickness(int joint) {
  switch (joint) {
    case 1:
    case 15:
    case 16:
    case 17:
    case 18:
      return 0.16;
    case 5:
    case 11:
      return 0.20;
    case 8:
    case 14:
      return 0.18;
    default:
      return 0.14;
  }
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// Where the pixel (x, y) of `to` lies in the picture of `from`; NaN where `from` cannot see it.
class PixelMap {
 public:
  PixelMap(const geometry::RigCamera& from, const geometry::RigCamera& to)
      : projector_(from.camera),
        to_(to.camera),
        rotation_((from.cam_from_world.rotation * to.cam_from_world.rotation.conjugate()).toRotationMatrix()) {
    MVS_CHECK(to_.model == geometry::LensModel::kPinhole, "the crop's camera must be a pinhole");
  }
  Eigen::Vector2d operator()(double x, double y) const {
    const Eigen::Vector3d ray((x - to_.cx()) / to_.fx(), (y - to_.cy()) / to_.fy(), 1);
    const geometry::Projection projection = projector_.Project(rotation_ * ray);
    return projection.status == Status::kOk ? projection.px
                                            : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  }

 private:
  geometry::Projector projector_;
  geometry::Camera to_;
  Eigen::Matrix3d rotation_;
};

// Samples a side of a pixel: source pixels between the projections of neighbouring pixels, at the worst of five places.
int SamplesPerSide(const PixelMap& map, int width, int height) {
  double shrink = 1;
  const double places[][2] = {{0.5, 0.5}, {0.1, 0.1}, {0.9, 0.1}, {0.1, 0.9}, {0.9, 0.9}};
  for (const auto& place : places) {
    const double x = place[0] * width, y = place[1] * height;
    const Eigen::Vector2d here = map(x, y), right = map(x + 1, y), below = map(x, y + 1);
    for (const double step : {(right - here).norm(), (below - here).norm()}) {
      if (std::isfinite(step)) shrink = std::max(shrink, step);
    }
  }
  return std::min(kMaxSamples, static_cast<int>(std::ceil(shrink - 1e-6)));
}

// Adds the bilinear sample at px to sum[0 .. channels).
void AddBilinear(const Image& image, const Eigen::Vector2d& px, float* sum) {
  const double x = px[0], y = px[1];
  if (!(x > -0.5 && y > -0.5 && x < image.width - 0.5 && y < image.height - 0.5)) return;
  const double cx = std::clamp(x, 0.0, image.width - 1.0), cy = std::clamp(y, 0.0, image.height - 1.0);
  const int x0 = std::min(static_cast<int>(cx), std::max(0, image.width - 2)),
            y0 = std::min(static_cast<int>(cy), std::max(0, image.height - 2));
  const int x1 = std::min(x0 + 1, image.width - 1), y1 = std::min(y0 + 1, image.height - 1);
  const float fx = static_cast<float>(cx - x0), fy = static_cast<float>(cy - y0);
  const uint8_t *a = image.Pixel(x0, y0), *b = image.Pixel(x1, y0), *c = image.Pixel(x0, y1), *d = image.Pixel(x1, y1);
  for (int k = 0; k < image.channels; ++k) {
    sum[k] += (1 - fy) * ((1 - fx) * a[k] + fx * b[k]) + fy * ((1 - fx) * c[k] + fx * d[k]);
  }
}

}  // namespace

std::array<bool, 19> PlausibleJoints(const dataset::Coco19Pose& pose) {
  std::array<bool, 19> plausible{};
  std::vector<double> coordinates[3];
  for (int j = 0; j < 19; ++j) {
    plausible[j] = pose.valid[j] && pose.x_in_world.col(j).allFinite();
    for (int k = 0; plausible[j] && k < 3; ++k) coordinates[k].push_back(pose.x_in_world(k, j));
  }
  if (coordinates[0].empty()) return plausible;
  const Eigen::Vector3d median(Median(coordinates[0]), Median(coordinates[1]), Median(coordinates[2]));
  for (int j = 0; j < 19; ++j) plausible[j] = plausible[j] && (pose.x_in_world.col(j) - median).norm() <= kMaxReachM;
  return plausible;
}

std::optional<PersonExtent> MeasurePerson(const dataset::Coco19Pose& pose, const geometry::RigCamera& camera) {
  const std::array<bool, 19> plausible = PlausibleJoints(pose);
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (int j = 0; j < 19; ++j) {
    if (!plausible[j]) continue;
    const Eigen::Vector3d x = camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j));
    if (x[2] < kMinDepthM) return std::nullopt;
    const double r = Thickness(j);
    low = low.cwiseMin(x - Eigen::Vector3d(r, r, 0)), high = high.cwiseMax(x + Eigen::Vector3d(r, r, 0));
  }
  if (!low.allFinite()) return std::nullopt;
  PersonExtent extent;
  extent.middle_in_cam = (low + high) / 2;
  const Eigen::Quaterniond crop_from_cam = Eigen::Quaterniond::FromTwoVectors(extent.middle_in_cam, Eigen::Vector3d::UnitZ());
  const double depth = extent.middle_in_cam.norm();
  for (int j = 0; j < 19; ++j) {
    if (!plausible[j]) continue;
    const Eigen::Vector3d x = crop_from_cam * (camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j)));
    if (x[2] < kMinDepthM) return std::nullopt;
    const double reach = std::max(std::abs(x[0]), std::abs(x[1])) + Thickness(j);
    extent.half_extent_m = std::max(extent.half_extent_m, reach * depth / x[2]);
  }
  return extent;
}

geometry::RigCamera CropCamera(const geometry::RigCamera& camera, const Eigen::Vector3d& middle_in_cam, double half_extent_m,
                               double fill, int size_px) {
  MVS_CHECK(half_extent_m > 0 && fill > 0 && size_px > 0 && middle_in_cam[2] > 0,
            "half_extent_m = " << half_extent_m << ", fill = " << fill << ", size_px = " << size_px
                               << ", depth = " << middle_in_cam[2]);
  geometry::RigCamera crop;
  const double focal_px = fill * (size_px / 2.0) * middle_in_cam.norm() / half_extent_m;
  crop.camera = geometry::MakePinhole(camera.camera.name, size_px, size_px, focal_px);
  const Eigen::Quaterniond crop_from_cam = Eigen::Quaterniond::FromTwoVectors(middle_in_cam, Eigen::Vector3d::UnitZ());
  crop.cam_from_world = geometry::Rigid3{crop_from_cam, Eigen::Vector3d::Zero()} * camera.cam_from_world;
  return crop;
}

Image Resample(const Image& source, const geometry::RigCamera& from, const geometry::RigCamera& to) {
  MVS_CHECK(source.width == from.camera.width_px && source.height == from.camera.height_px,
            "picture of " << source.width << "x" << source.height << " for camera " << from.camera.name << " of "
                          << from.camera.width_px << "x" << from.camera.height_px);
  MVS_CHECK(source.channels >= 1 && source.channels <= 4, source.channels << " channels");
  const PixelMap map(from, to);
  Image out(to.camera.width_px, to.camera.height_px, source.channels);
  const int samples = SamplesPerSide(map, out.width, out.height);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      float sum[4] = {0, 0, 0, 0};
      for (int i = 0; i < samples * samples; ++i) {
        const double dx = (i % samples + 0.5) / samples - 0.5, dy = (i / samples + 0.5) / samples - 0.5;
        AddBilinear(source, map(x + dx, y + dy), sum);
      }
      for (int k = 0; k < source.channels; ++k) {
        out.Pixel(x, y)[k] =
            static_cast<uint8_t>(std::clamp(sum[k] / static_cast<float>(samples * samples) + 0.5f, 0.f, 255.f));
      }
    }
  }
  return out;
}

}  // namespace mvstudio::avatar
