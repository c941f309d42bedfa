#include "dataset/views/undistort.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/error.h"
#include "core/format.h"
#include "core/random.h"

namespace mvstudio::dataset {
namespace {

constexpr ChoiceWords<UndistortView, 4> kUndistortViews = {{{UndistortView::kInside, "inside"},
                                                            {UndistortView::kAll, "all"},
                                                            {UndistortView::kKeep, "keep"},
                                                            {UndistortView::kCentred, "centred"}}};

constexpr int kGrid = 48;    // cells a side of the images that are examined
constexpr int kBorder = 64;  // points a side of a border
constexpr int kMaxSizePx = 32768;
constexpr double kPi = 3.14159265358979323846;

// An axis-aligned rectangle in the plane z = 1 of the camera.
struct PlaneBox {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  bool empty() const { return !(low.array() < high.array()).all(); }
  Eigen::Vector2d middle() const { return (low + high) / 2; }
};

// What a lens sees of the plane z = 1, up to a largest tangent along either axis.
class Field {
 public:
  Field(const geometry::Camera& camera, double max_tangent) : lens_(camera), max_tangent_(max_tangent) {}

  // Plane point of a pixel; nothing where it lies beyond the field or the lens has no inverse.
  bool PlanePoint(const Eigen::Vector2d& px, Eigen::Vector2d* point) const {
    const geometry::Unprojection ray = lens_.Unproject(px);
    if (ray.status != Status::kOk || !(ray.ray_in_cam[2] > 0)) return false;
    *point = ray.ray_in_cam.head<2>() / ray.ray_in_cam[2];
    return point->allFinite() && point->cwiseAbs().maxCoeff() <= max_tangent_;
  }
  bool Shows(const Eigen::Vector2d& point) const {
    if (point.cwiseAbs().maxCoeff() > max_tangent_ * (1 + 1e-12)) return false;
    const geometry::Projection seen = lens_.Project(point.homogeneous());
    return seen.status == Status::kOk && geometry::InImage(lens_.camera(), seen.px);
  }
  // True when the whole border of a box is in the image; the inside then is, too.
  bool ShowsBox(const Eigen::Vector2d& middle, const Eigen::Vector2d& half) const {
    for (int i = 0; i <= kBorder; ++i) {
      const double t = 2.0 * i / kBorder - 1;
      for (const Eigen::Vector2d& corner :
           {Eigen::Vector2d(t, -1), Eigen::Vector2d(t, 1), Eigen::Vector2d(-1, t), Eigen::Vector2d(1, t)}) {
        if (!Shows(middle + corner.cwiseProduct(half))) return false;
      }
    }
    return true;
  }
  const geometry::Camera& camera() const { return lens_.camera(); }
  double max_tangent() const { return max_tangent_; }

 private:
  geometry::Projector lens_;
  double max_tangent_;
};

Eigen::Vector2d GridPixel(const geometry::Camera& camera, double i, double j, int cells) {
  return {i / cells * camera.width_px - 0.5, j / cells * camera.height_px - 0.5};
}

// The box around all plane points that the image shows.
PlaneBox OuterBox(const Field& field) {
  PlaneBox box;
  for (int j = 0; j <= kGrid; ++j) {
    for (int i = 0; i <= kGrid; ++i) {
      Eigen::Vector2d point;
      if (!field.PlanePoint(GridPixel(field.camera(), i, j, kGrid), &point)) continue;
      box.low = box.low.cwiseMin(point), box.high = box.high.cwiseMax(point);
    }
  }
  return box;
}

// Largest box between the four sides of the image's border, as far as that has plane points.
PlaneBox InnerBox(const Field& field) {
  PlaneBox box;
  box.low.setConstant(-field.max_tangent()), box.high.setConstant(field.max_tangent());
  for (int k = 0; k <= kBorder; ++k) {
    Eigen::Vector2d point;
    const double t = static_cast<double>(k);
    if (field.PlanePoint(GridPixel(field.camera(), 0, t, kBorder), &point)) box.low[0] = std::max(box.low[0], point[0]);
    if (field.PlanePoint(GridPixel(field.camera(), kBorder, t, kBorder), &point)) box.high[0] = std::min(box.high[0], point[0]);
    if (field.PlanePoint(GridPixel(field.camera(), t, 0, kBorder), &point)) box.low[1] = std::max(box.low[1], point[1]);
    if (field.PlanePoint(GridPixel(field.camera(), t, kBorder, kBorder), &point)) box.high[1] = std::min(box.high[1], point[1]);
  }
  return box;
}

// The largest box of the given shape about `middle` that shows no border; zero when there is none.
Eigen::Vector2d LargestInside(const Field& field, const Eigen::Vector2d& middle, const Eigen::Vector2d& shape) {
  double inside = 0, outside = 1;
  while (outside > 1e-9 && !field.ShowsBox(middle, outside * shape)) outside /= 2;
  if (outside <= 1e-9) return Eigen::Vector2d::Zero();
  inside = outside, outside *= 2;
  while (outside < 1e6 && field.ShowsBox(middle, outside * shape)) inside = outside, outside *= 2;
  for (int i = 0; i < 50; ++i) {
    const double half = (inside + outside) / 2;
    (field.ShowsBox(middle, half * shape) ? inside : outside) = half;
  }
  return inside * shape;
}

// Pinhole of width x height pixels that shows middle +- half of the plane z = 1.
geometry::Camera PinholeFor(const geometry::Camera& named, const Eigen::Vector2d& middle, const Eigen::Vector2d& half,
                            int width, int height) {
  geometry::Camera pinhole = geometry::MakePinhole(named.name, width, height, 1);
  const double fx = width / (2 * half[0]), fy = height / (2 * half[1]);
  pinhole.params << fx, fy, (width - 1) / 2.0 - fx * middle[0], (height - 1) / 2.0 - fy * middle[1];
  return pinhole;
}

geometry::Camera KeptPinhole(const geometry::Camera& source, int width, int height) {
  geometry::Camera pinhole = geometry::PinholeOf(source);
  const double sx = static_cast<double>(width) / source.width_px, sy = static_cast<double>(height) / source.height_px;
  pinhole.params[0] *= sx, pinhole.params[1] *= sy;
  pinhole.params[2] = sx * (pinhole.params[2] + 0.5) - 0.5, pinhole.params[3] = sy * (pinhole.params[3] + 0.5) - 0.5;
  pinhole.width_px = width, pinhole.height_px = height;
  return pinhole;
}

// Shares of the two images, over the middles of a grid of cells.
void MeasureShares(const Field& field, UndistortedCamera* result) {
  const geometry::Projector pinhole(result->camera.camera);
  int lost = 0, empty = 0;
  for (int j = 0; j < kGrid; ++j) {
    for (int i = 0; i < kGrid; ++i) {
      Eigen::Vector2d point;
      const bool has_ray = field.PlanePoint(GridPixel(field.camera(), i + 0.5, j + 0.5, kGrid), &point);
      lost += !has_ray || !geometry::InImage(pinhole.camera(), pinhole.Project(point.homogeneous()).px);
      const Eigen::Vector3d ray = pinhole.Unproject(GridPixel(pinhole.camera(), i + 0.5, j + 0.5, kGrid)).ray_in_cam;
      empty += !field.Shows(ray.hnormalized());
    }
  }
  result->lost_share = static_cast<double>(lost) / (kGrid * kGrid);
  result->empty_share = static_cast<double>(empty) / (kGrid * kGrid);
}

// Share of the image without a plane point in the field.
double ShareBeyond(const Field& field) {
  int beyond = 0;
  for (int j = 0; j <= kGrid; ++j) {
    for (int i = 0; i <= kGrid; ++i) {
      Eigen::Vector2d point;
      beyond += !field.PlanePoint(GridPixel(field.camera(), i, j, kGrid), &point);
    }
  }
  return static_cast<double>(beyond) / ((kGrid + 1) * (kGrid + 1));
}

void CheckOptions(const UndistortOptions& options) {
  for (const int size : {options.width_px, options.height_px}) {
    if (size < 0 || size > kMaxSizePx)
      throw UsageError("undistorted images of " + std::to_string(size) + " px: 1 to 32768, or 0");
  }
  if (!(options.max_fov_deg > 0 && options.max_fov_deg < 180)) {
    throw UsageError("undistort-max-fov " + std::to_string(options.max_fov_deg) + ": more than 0 and less than 180 degrees");
  }
}

UndistortedCamera Refuse(Status status, const std::string& reason) {
  UndistortedCamera result;
  result.status = status, result.reason = reason;
  result.lost_share = result.empty_share = 1;
  return result;
}

UndistortedCamera WhyImpossible(const geometry::RigCamera& source) {
  const geometry::Camera& camera = source.camera;
  if (!camera.params.allFinite() || !source.cam_from_world.rotation.coeffs().allFinite() ||
      !source.cam_from_world.translation.allFinite()) {
    return Refuse(Status::kNonFiniteInput, "camera " + camera.name + " has a parameter that is not a finite number");
  }
  const std::string fault = geometry::WhyInvalidLens(camera);
  if (!fault.empty()) return Refuse(Status::kDegenerate, "camera " + camera.name + ": " + fault);
  if (camera.width_px < 1 || camera.height_px < 1)
    return Refuse(Status::kDegenerate, "camera " + camera.name + " has no image");
  return {};
}

// Sets the pinhole; false when the lens shows nothing of the plane.
bool ChoosePinhole(const Field& field, const UndistortOptions& options, int width, int height, geometry::Camera* pinhole) {
  const geometry::Camera& source = field.camera();
  const geometry::Camera kept = KeptPinhole(source, width, height);
  const Eigen::Vector2d shape(width / kept.fx(), height / kept.fy());  // pixels keep their shape
  const PlaneBox outer = OuterBox(field);
  if (outer.empty()) return false;
  if (options.view == UndistortView::kKeep) {
    *pinhole = kept;
    return true;
  }
  if (options.view == UndistortView::kAll) {
    const double scale = ((outer.high - outer.low).array() / shape.array()).maxCoeff();
    *pinhole = PinholeFor(source, outer.middle(), scale / 2 * shape, width, height);
    return true;
  }
  if (options.view == UndistortView::kCentred) {
    const Eigen::Vector2d half = LargestInside(field, Eigen::Vector2d::Zero(), shape);
    *pinhole = half.isZero() ? kept : PinholeFor(source, Eigen::Vector2d::Zero(), half, width, height);
    return !half.isZero();
  }
  const PlaneBox inner = InnerBox(field);
  Eigen::Vector2d middle = inner.middle();
  Eigen::Vector2d half = inner.empty() ? Eigen::Vector2d::Zero() : LargestInside(field, middle, shape);
  if (half.isZero() && field.PlanePoint(GridPixel(source, 0.5, 0.5, 1), &middle)) half = LargestInside(field, middle, shape);
  if (half.isZero()) return false;
  *pinhole = PinholeFor(source, middle, half, width, height);
  return true;
}

}  // namespace

std::string_view ToString(UndistortView view) { return WordOf(kUndistortViews, view); }

void FromString(const std::string& text, UndistortView* view) {
  *view = KnownChoice(kUndistortViews, text, "undistort-view '" + text + "': inside, all, keep or centred");
}

bool IsCentred(const geometry::Camera& camera) {
  const Eigen::Vector2d centre((camera.width_px - 1) / 2.0, (camera.height_px - 1) / 2.0);
  return (Eigen::Vector2d(camera.cx(), camera.cy()) - centre).cwiseAbs().maxCoeff() < 1e-6;
}

UndistortedCamera IdealPinhole(const geometry::RigCamera& source, const UndistortOptions& options) {
  CheckOptions(options);
  UndistortedCamera result = WhyImpossible(source);
  if (!result.usable()) return result;
  const int width = options.width_px ? options.width_px : source.camera.width_px,
            height = options.height_px ? options.height_px : source.camera.height_px;
  const bool same_size = width == source.camera.width_px && height == source.camera.height_px;
  result.camera.cam_from_world = source.cam_from_world;
  const bool needs_centre = options.view == UndistortView::kCentred && !IsCentred(source.camera);
  if (source.camera.model == geometry::LensModel::kPinhole && same_size && !needs_centre) {
    result.camera.camera = source.camera;
    return result;
  }
  const Field field(source.camera, std::tan(options.max_fov_deg / 2 * kPi / 180));
  if (!ChoosePinhole(field, options, width, height, &result.camera.camera)) {
    return Refuse(Status::kDegenerate,
                  "camera " + source.camera.name +
                      (options.view == UndistortView::kCentred ? ": its image does not reach around its optical axis"
                                                               : ": its lens shows nothing that a pinhole could"));
  }
  const std::string fault = geometry::WhyInvalidLens(result.camera.camera);
  if (!fault.empty()) return Refuse(Status::kDegenerate, "camera " + source.camera.name + ", undistorted: " + fault);
  MeasureShares(field, &result);
  const double beyond = ShareBeyond(field);
  if (beyond > 0) {
    const std::string text = Format(": %.1f %% of its image lies beyond a field of view of %.0f degrees or the lens's fold",
                                    100 * beyond, options.max_fov_deg);
    result.status = Status::kOutsideValidRadius;
    result.reason = "camera " + source.camera.name + text;
  }
  return result;
}

Undistorter::Undistorter(const geometry::RigCamera& source, const geometry::RigCamera& pinhole)
    : map_(source, pinhole), validity_(map_.Validity()) {}

Image Undistorter::Apply(const Image& source, int num_threads) const { return map_.Apply(source, Border::kLeave, num_threads); }

Image Undistorter::Mask(const Image& source, int num_threads) const { return map_.Mask(source, num_threads); }

namespace {

// Waves of random direction and phase, none shorter than `finest_px`.
Image BandLimitedImage(int width, int height, double finest_px, uint64_t seed) {
  constexpr int kWaves = 24;
  Rng rng(seed);
  Eigen::Array<double, 3, kWaves> waves;  // radians a pixel along x and y, phase
  for (int k = 0; k < kWaves; ++k) {
    const double angle = rng.Uniform(0, 2 * kPi), frequency = 2 * kPi / (finest_px * rng.Uniform(1, 6));
    waves.col(k) << frequency * std::cos(angle), frequency * std::sin(angle), rng.Uniform(0, 2 * kPi);
  }
  Image image(width, height, 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double sum = (waves.row(0) * x + waves.row(1) * y + waves.row(2)).sin().sum();
      *image.Pixel(x, y) = static_cast<uint8_t>(std::lround(std::clamp(127.5 + 22 * sum, 0.0, 255.0)));
    }
  }
  return image;
}

// Of the pixels that come back from an image that is white all over as white.
double PsnrThereAndBack(const ResampleMap& there, const ResampleMap& back, const Image& image) {
  const Image returned = back.Apply(there.Apply(image));
  const Image whole = back.Apply(there.Apply(Image(image.width, image.height, 1, 255)));
  double sum = 0;
  int64_t count = 0;
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    if (whole.pixels[i] < 255) continue;
    const double difference = static_cast<double>(returned.pixels[i]) - image.pixels[i];
    sum += difference * difference, ++count;
  }
  if (count == 0) return std::numeric_limits<double>::quiet_NaN();
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(count) / std::max(sum, 1e-9));
}

}  // namespace

UndistortionError MeasureUndistortion(const geometry::RigCamera& source, const geometry::RigCamera& pinhole, uint64_t seed,
                                      bool with_image) {
  const ResampleMap there(source, pinhole), back(pinhole, source);
  const geometry::Projector lens(source.camera), ideal(pinhole.camera);
  const geometry::Rigid3 world_from_source = geometry::Inverse(source.cam_from_world);
  UndistortionError error;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const Eigen::Vector2d px = GridPixel(source.camera, i % kGrid + 0.5, i / kGrid + 0.5, kGrid);
    const geometry::Unprojection ray = lens.Unproject(px);
    if (ray.status != Status::kOk) continue;
    const Eigen::Vector3d joint = world_from_source * Eigen::Vector3d((1 + i % 7) * ray.ray_in_cam);
    const geometry::Projection exact = lens.Project(source.cam_from_world * joint),
                               undistorted = ideal.Project(pinhole.cam_from_world * joint);
    if (exact.status != Status::kOk || undistorted.status != Status::kOk || !geometry::InImage(pinhole.camera, undistorted.px))
      continue;
    error.max_joint_px = std::max(error.max_joint_px, (there.SourceOf(undistorted.px) - exact.px).norm());
    error.max_map_px = std::max(error.max_map_px, (there.SampledSourceOf(undistorted.px) - exact.px).norm());
  }
  error.finest_px = std::max(16.0, 8.0 * std::max(there.samples_per_side(), back.samples_per_side()));
  error.psnr_db = std::numeric_limits<double>::quiet_NaN();
  if (!with_image) return error;
  error.psnr_db =
      PsnrThereAndBack(there, back, BandLimitedImage(source.camera.width_px, source.camera.height_px, error.finest_px, seed));
  return error;
}

}  // namespace mvstudio::dataset
