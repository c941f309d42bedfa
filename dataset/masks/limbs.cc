#include "dataset/masks/limbs.h"

#include <algorithm>
#include <cmath>

#include "dataset/masks/patch.h"
#include "geometry/lens/camera.h"

namespace mvstudio::dataset {
namespace {

using geometry::Projector;
using geometry::RigCamera;
using internal::kBones;
using internal::kLimbs;
using internal::LimbShape;

struct View {
  const RigCamera& camera;
  Projector projector;
  const MaskOptions& options;
  ProjectedBody* body;

  bool Project(const Eigen::Vector3d& x_in_world, Eigen::Vector2d* px, double* px_per_m) const {
    const Eigen::Vector3d x_in_cam = camera.cam_from_world * x_in_world;
    const geometry::Projection projection = projector.Project(x_in_cam);
    if (projection.status != Status::kOk) return false;
    *px = projection.px;
    *px_per_m = 0.5 * (camera.camera.fx() + camera.camera.fy()) / x_in_cam.z();
    return true;
  }

  void Add(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius_a_m, double radius_b_m) const {
    BodyCapsule limb;
    double scale_a = 0, scale_b = 0;
    if (!Project(a, &limb.a_px, &scale_a) || !Project(b, &limb.b_px, &scale_b)) return;
    limb.radius_a_px = radius_a_m * scale_a * options.body_scale;
    limb.radius_b_px = radius_b_m * scale_b * options.body_scale;
    limb.px_per_m = 0.5 * (scale_a + scale_b);
    body->limbs.push_back(limb);
  }
};

void AddHead(const Coco19Pose& pose, const View& view) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const int j : {16, 18}) {
    if (pose.valid[j]) sum += pose.x_in_world.col(j), ++count;
  }
  if (count == 0 && pose.valid[1]) sum = pose.x_in_world.col(1), count = 1;
  if (count == 0) return;
  const Eigen::Vector3d middle = sum / count;
  if (!pose.valid[0]) return view.Add(middle, middle, 0.11, 0.11);
  const Eigen::Vector3d neck = pose.x_in_world.col(0);
  const Eigen::Vector3d up = (middle - neck).normalized();
  view.Add(neck, middle, 0.07, 0.08);
  view.Add(middle, middle + 0.05 * up, 0.095, 0.095);
  if (pose.valid[1]) view.Add(middle, pose.x_in_world.col(1), 0.08, 0.04);
}

void AddHand(const Coco19Pose& pose, int elbow, int wrist, const View& view) {
  if (!pose.valid[elbow] || !pose.valid[wrist]) return;
  const Eigen::Vector3d x = pose.x_in_world.col(wrist);
  const Eigen::Vector3d along = (x - pose.x_in_world.col(elbow)).normalized();
  view.Add(x, x + 0.15 * along, 0.045, 0.045);
}

/// The foot points where the hips face, across the shin.
void AddFoot(const Coco19Pose& pose, int knee, int ankle, const View& view) {
  if (!pose.valid[knee] || !pose.valid[ankle] || !pose.valid[6] || !pose.valid[12]) return;
  const Eigen::Vector3d x = pose.x_in_world.col(ankle);
  const Eigen::Vector3d down = (x - pose.x_in_world.col(knee)).normalized();
  const Eigen::Vector3d left = pose.x_in_world.col(6) - pose.x_in_world.col(12);
  const Eigen::Vector3d forward = left.cross(-down).normalized();
  if (!forward.allFinite() || forward.norm() < 0.5) return view.Add(x, x + 0.06 * down, 0.07, 0.07);
  view.Add(x - 0.04 * forward + 0.05 * down, x + 0.14 * forward + 0.06 * down, 0.05, 0.045);
}

void AddPerson(const Coco19Pose& pose, const View& view) {
  for (const LimbShape& limb : kLimbs) {
    if (!pose.valid[limb.a] || !pose.valid[limb.b]) continue;
    view.Add(pose.x_in_world.col(limb.a), pose.x_in_world.col(limb.b), limb.radius_a_m, limb.radius_b_m);
  }
  AddHead(pose, view);
  AddHand(pose, 4, 5, view);
  AddHand(pose, 10, 11, view);
  AddFoot(pose, 7, 8, view);
  AddFoot(pose, 13, 14, view);
  for (const auto& [a, b] : kBones) {
    Eigen::Vector2d a_px, b_px;
    double unused = 0;
    if (pose.valid[a] && pose.valid[b] && view.Project(pose.x_in_world.col(a), &a_px, &unused) &&
        view.Project(pose.x_in_world.col(b), &b_px, &unused)) {
      view.body->bones.emplace_back(a_px, b_px);
    }
  }
  for (int j = 0; j < 19; ++j) {
    Eigen::Vector2d px;
    double unused = 0;
    if (pose.valid[j] && view.Project(pose.x_in_world.col(j), &px, &unused) && InImage(view.camera.camera, px)) {
      view.body->joints_px.push_back(px);
    }
  }
}

}  // namespace

ProjectedBody ProjectBody(const std::map<int, Coco19Pose>& people, const RigCamera& camera, const MaskOptions& options) {
  ProjectedBody body;
  const View view{camera, Projector(camera.camera), options, &body};
  for (const auto& [id, pose] : people) AddPerson(pose, view);
  return body;
}

namespace internal {

LimbDistance DistanceToBody(const ProjectedBody& body, const Eigen::Vector2d& px) {
  LimbDistance nearest;
  for (const BodyCapsule& limb : body.limbs) {
    const Eigen::Vector2d along = limb.b_px - limb.a_px;
    const double length2 = along.squaredNorm();
    const double t = length2 > 0 ? std::clamp((px - limb.a_px).dot(along) / length2, 0.0, 1.0) : 0.0;
    const double distance = (px - limb.a_px - t * along).norm();
    const double radius = (1 - t) * limb.radius_a_px + t * limb.radius_b_px;
    nearest.outside_m = std::min(nearest.outside_m, (distance - radius) / limb.px_per_m);
    nearest.relative = std::min(nearest.relative, distance / std::max(radius, 1e-6));
  }
  return nearest;
}

PixelBox BoxOfBody(const ProjectedBody& body, int width, int height, double margin_m) {
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  for (const BodyCapsule& limb : body.limbs) {
    const double pad = std::max(limb.radius_a_px, limb.radius_b_px) + margin_m * limb.px_per_m;
    low = low.cwiseMin(limb.a_px.cwiseMin(limb.b_px) - Eigen::Vector2d::Constant(pad));
    high = high.cwiseMax(limb.a_px.cwiseMax(limb.b_px) + Eigen::Vector2d::Constant(pad));
  }
  PixelBox box;
  if (body.empty()) return box;
  box.x0 = static_cast<int>(std::clamp(std::floor(low.x()), 0.0, double(width)));
  box.y0 = static_cast<int>(std::clamp(std::floor(low.y()), 0.0, double(height)));
  box.x1 = static_cast<int>(std::clamp(std::ceil(high.x()) + 1, 0.0, double(width)));
  box.y1 = static_cast<int>(std::clamp(std::ceil(high.y()) + 1, 0.0, double(height)));
  return box;
}

double TypicalPxPerM(const ProjectedBody& body) {
  double sum = 0;
  for (const BodyCapsule& limb : body.limbs) sum += limb.px_per_m;
  return sum / static_cast<double>(body.limbs.size());
}

}  // namespace internal

Image BodyRegion(const ProjectedBody& body, int width, int height, double margin_m) {
  Image region(width, height, 1, 0);
  for (const BodyCapsule& limb : body.limbs) {
    const ProjectedBody one{{limb}, {}, {}};
    const internal::PixelBox box = internal::BoxOfBody(one, width, height, std::max(margin_m, 0.0));
    for (int y = box.y0; y < box.y1; ++y) {
      for (int x = box.x0; x < box.x1; ++x) {
        uint8_t* pixel = region.Pixel(x, y);
        if (!*pixel && internal::DistanceToBody(one, {double(x), double(y)}).outside_m < margin_m) *pixel = 255;
      }
    }
  }
  return region;
}

}  // namespace mvstudio::dataset
