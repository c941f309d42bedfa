#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/parallel.h"
#include "core/random.h"
#include "dataset/colour/colour_space.h"
#include "dataset/views/crop.h"

namespace mvstudio::dataset {
namespace {

constexpr double kReachM = 0.35;           // beyond the joints
constexpr int64_t kMaxVoxels = 6'000'000;  // of a frame
constexpr int kMinHullCameras = 3;
constexpr double kLeastCosine = 0.5;  // between normal and line of sight
constexpr int kMaxPatchPx = 12;
constexpr uint8_t kDark = 2, kBright = 253;  // channels at or beyond are clipped

/// The cameras of one frame that have a mask and an image.
struct FrameViews {
  struct View {
    int camera_idx;
    geometry::Projector lens;
    geometry::Rigid3 cam_from_world;
    Eigen::Vector3d centre_in_world;
    Image mask, image;
  };
  std::vector<View> views;
};

bool MaskAt(const FrameViews::View& view, const Eigen::Vector3d& x_in_world, bool* in_image) {
  const geometry::Projection p = view.lens.Project(view.cam_from_world * x_in_world);
  *in_image = p.status == Status::kOk && geometry::InImage(view.lens.camera(), p.px);
  return *in_image && *view.mask.Pixel(static_cast<int>(p.px[0] + 0.5), static_cast<int>(p.px[1] + 0.5)) >= 128;
}

/// Visual hull on a grid: 1 where every camera that sees the voxel has it on its mask, and three at least see it.
struct Hull {
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  double voxel_m = 0;
  Eigen::Array3i size = Eigen::Array3i::Zero();
  std::vector<uint8_t> inside;

  bool Has(const Eigen::Array3i& v) const { return (v >= 0).all() && (v < size).all(); }
  bool At(const Eigen::Array3i& v) const { return Has(v) && inside[Index(v)]; }
  size_t Index(const Eigen::Array3i& v) const { return (static_cast<size_t>(v[2]) * size[1] + v[1]) * size[0] + v[0]; }
  Eigen::Vector3d Middle(const Eigen::Array3i& v) const { return low + voxel_m * (v.cast<double>() + 0.5).matrix(); }
  Eigen::Array3i VoxelOf(const Eigen::Vector3d& x) const { return ((x - low) / voxel_m).array().floor().cast<int>(); }
};

bool InHull(const FrameViews& frame, const Eigen::Vector3d& x) {
  int seen = 0;
  for (const FrameViews::View& view : frame.views) {
    bool in_image = false;
    if (!MaskAt(view, x, &in_image) && in_image) return false;
    seen += in_image;
  }
  return seen >= kMinHullCameras;
}

Hull MakeHull(const FrameViews& frame, const std::map<int, Coco19Pose>& people, double voxel_m) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const auto& [id, pose] : people) {
    const std::array<bool, 19> plausible = PlausibleJoints(pose);
    for (int j = 0; j < 19; ++j) {
      if (!plausible[j]) continue;
      low = low.cwiseMin(pose.x_in_world.col(j)), high = high.cwiseMax(pose.x_in_world.col(j));
    }
  }
  Hull hull;
  if (!low.allFinite()) return hull;
  hull.low = low.array() - kReachM;
  const Eigen::Array3d extent = (high - low).array() + 2 * kReachM;
  hull.voxel_m = std::max(voxel_m, std::cbrt(extent.prod() / static_cast<double>(kMaxVoxels)));
  hull.size = (extent / hull.voxel_m).ceil().cast<int>();
  hull.inside.assign(static_cast<size_t>(hull.size[0]) * hull.size[1] * hull.size[2], 0);
  Eigen::Array3i v;
  for (v[2] = 0; v[2] < hull.size[2]; ++v[2]) {
    for (v[1] = 0; v[1] < hull.size[1]; ++v[1]) {
      for (v[0] = 0; v[0] < hull.size[0]; ++v[0]) hull.inside[hull.Index(v)] = InHull(frame, hull.Middle(v));
    }
  }
  return hull;
}

/// From the inside outwards, over 5 x 5 x 5 voxels; zero where there is no direction.
Eigen::Vector3d Normal(const Hull& hull, const Eigen::Array3i& v) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i < 125; ++i) {
    const Eigen::Array3i offset(i % 5 - 2, i / 5 % 5 - 2, i / 25 - 2);
    if (!hull.At(v + offset)) sum += offset.cast<double>().matrix();
  }
  const double length = sum.norm();
  return length > 1e-9 ? Eigen::Vector3d(sum / length) : Eigen::Vector3d::Zero();
}

std::vector<Eigen::Array3i> SurfaceVoxels(const Hull& hull) {
  std::vector<Eigen::Array3i> surface;
  Eigen::Array3i v;
  for (v[2] = 1; v[2] < hull.size[2] - 1; ++v[2]) {
    for (v[1] = 1; v[1] < hull.size[1] - 1; ++v[1]) {
      for (v[0] = 1; v[0] < hull.size[0] - 1; ++v[0]) {
        if (!hull.At(v)) continue;
        bool open = false;
        for (int axis = 0; axis < 3 && !open; ++axis) {
          const Eigen::Array3i step = Eigen::Vector3i::Unit(axis).array();
          open = !hull.At(v + step) || !hull.At(v - step);
        }
        if (open) surface.push_back(v);
      }
    }
  }
  return surface;
}

/// True when the hull lies between the point and the camera.
bool Hidden(const Hull& hull, const Eigen::Vector3d& x, const Eigen::Vector3d& towards_camera) {
  for (double distance = 2.5 * hull.voxel_m;; distance += hull.voxel_m) {
    const Eigen::Array3i v = hull.VoxelOf(x + distance * towards_camera);
    if (!hull.Has(v)) return false;
    if (hull.inside[hull.Index(v)]) return true;
  }
}

const std::array<double, 256>& LinearOfLevel() {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> values{};
    for (int i = 0; i < 256; ++i) values[i] = internal::LinearFromSrgb(i / 255.0);
    return values;
  }();
  return table;
}

/// Mean colour of a disc, in linear light, as sRGB. False when the disc leaves the mask or the image.
bool PatchColour(const FrameViews::View& view, const Eigen::Vector2d& px, double radius_px, ColourPoint::View* seen) {
  const int cx = static_cast<int>(px[0] + 0.5), cy = static_cast<int>(px[1] + 0.5);
  const int r = std::clamp(static_cast<int>(radius_px + 0.5), 0, kMaxPatchPx);
  const Image& image = view.image;
  if (cx - r < 0 || cy - r < 0 || cx + r >= image.width || cy + r >= image.height) return false;
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  Eigen::Array3i clipped = Eigen::Array3i::Zero();
  int count = 0;
  for (int y = -r; y <= r; ++y) {
    for (int x = -r; x <= r; ++x) {
      if (x * x + y * y > r * r + r) continue;
      if (*view.mask.Pixel(cx + x, cy + y) < 128) return false;
      const uint8_t* p = image.Pixel(cx + x, cy + y);
      for (int k = 0; k < 3; ++k) sum[k] += LinearOfLevel()[p[k]], clipped[k] += p[k] <= kDark || p[k] >= kBright;
      ++count;
    }
  }
  for (int k = 0; k < 3; ++k) {
    seen->as_seen[k] = internal::SrgbFromLinear(sum[k] / count);
    seen->srgb[k] = clipped[k] ? std::numeric_limits<double>::quiet_NaN() : seen->as_seen[k];
  }
  return true;
}

ColourPoint LookAt(const FrameViews& frame, const Hull& hull, const Eigen::Array3i& voxel, double patch_m) {
  ColourPoint point;
  point.x_in_world = hull.Middle(voxel);
  const Eigen::Vector3d normal = Normal(hull, voxel);
  point.x_in_world += 0.5 * hull.voxel_m * normal;
  for (const FrameViews::View& view : frame.views) {
    const Eigen::Vector3d towards = (view.centre_in_world - point.x_in_world).normalized();
    if (!(towards.dot(normal) > kLeastCosine)) continue;
    const Eigen::Vector3d x_in_cam = view.cam_from_world * point.x_in_world;
    const geometry::ProjectionWithJacobians p = view.lens.ProjectWithJacobians(x_in_cam);
    if (p.status != Status::kOk || Hidden(hull, point.x_in_world, towards)) continue;
    const double px_per_m = std::sqrt(p.d_px_d_x.squaredNorm() / 2);
    ColourPoint::View seen;
    seen.camera_idx = view.camera_idx;
    if (PatchColour(view, p.px, patch_m * px_per_m, &seen)) point.views.push_back(seen);
  }
  return point;
}

FrameViews ReadViews(const geometry::Rig& rig, int frame, const ImageSource& images, const ImageSource& masks) {
  FrameViews views;
  for (int c = 0; c < static_cast<int>(rig.cameras.size()); ++c) {
    const geometry::RigCamera& camera = rig.cameras[c];
    Image mask = masks(c, frame);
    if (mask.empty()) continue;
    Image image = images(c, frame);
    if (image.empty() || image.channels != 3) continue;
    const auto fits = [&](const Image& one) {
      return one.width == camera.camera.width_px && one.height == camera.camera.height_px;
    };
    if (!fits(mask) || !fits(image)) continue;
    views.views.push_back({c, geometry::Projector(camera.camera), camera.cam_from_world, camera.CenterInWorld(),
                           std::move(mask), std::move(image)});
  }
  return views;
}

std::vector<ColourPoint> SampleFrame(const FrameViews& views, const std::map<int, Coco19Pose>& people, int frame,
                                     const ColourMatchOptions& options, uint64_t seed) {
  std::vector<ColourPoint> points;
  if (static_cast<int>(views.views.size()) < kMinHullCameras) return points;
  const Hull hull = MakeHull(views, people, options.voxel_m);
  std::vector<Eigen::Array3i> surface = SurfaceVoxels(hull);
  Rng rng(seed + 7919 * static_cast<uint64_t>(frame));
  const size_t wanted = static_cast<size_t>(std::max(options.points, 0));
  for (size_t i = 0; i < surface.size() && points.size() < wanted; ++i) {
    std::swap(surface[i], surface[i + static_cast<size_t>(rng.Index(static_cast<int64_t>(surface.size() - i)))]);
    ColourPoint point = LookAt(views, hull, surface[i], options.patch_m);
    point.frame = frame;
    if (point.views.size() >= 2) points.push_back(std::move(point));
  }
  return points;
}

}  // namespace

std::vector<ColourPoint> SampleSurfaceColours(const geometry::Rig& rig, const std::map<int, std::map<int, Coco19Pose>>& poses,
                                              const ImageSource& images, const ImageSource& masks,
                                              const ColourMatchOptions& options, const RunContext& run) {
  std::vector<int> with_people, frames;
  for (const auto& [frame, people] : poses) {
    if (!people.empty()) with_people.push_back(frame);
  }
  const size_t count = std::min(with_people.size(), static_cast<size_t>(std::max(options.frames, 1)));
  for (size_t i = 0; i < count; ++i) frames.push_back(with_people[(2 * i + 1) * with_people.size() / (2 * count)]);
  std::vector<std::vector<ColourPoint>> of_frame(frames.size());
  ParallelFor(static_cast<int64_t>(frames.size()), run.num_threads, [&](int64_t i) {
    const FrameViews views = ReadViews(rig, frames[i], images, masks);
    of_frame[i] = SampleFrame(views, poses.at(frames[i]), frames[i], options, run.seed);
  });
  std::vector<ColourPoint> points;
  for (std::vector<ColourPoint>& part : of_frame) points.insert(points.end(), part.begin(), part.end());
  return points;
}

}  // namespace mvstudio::dataset
