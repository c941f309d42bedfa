#include "avatar/run/references/references.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/error.h"
#include "core/parallel.h"
#include "geometry/rig/alignment.h"

namespace mvstudio::avatar {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kLeastCosine = 0.25f;
constexpr float kDepthTolerance = 0.01f;  // m

std::vector<Vector3f> InCamera(const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera) {
  std::vector<Vector3f> in_cam(static_cast<size_t>(vertices_in_world.cols()));
  for (size_t i = 0; i < in_cam.size(); ++i)
    in_cam[i] = (camera.cam_from_world * Eigen::Vector3d(vertices_in_world.col(static_cast<Eigen::Index>(i)).cast<double>()))
                    .cast<float>();
  return in_cam;
}

double FacingOf(const body::BodyTemplate& body, const ReferenceView& view) {
  const Eigen::Matrix3Xd rest = body.vertices.cast<double>(), posed = view.vertices->cast<double>();
  const geometry::Rigid3 world_from_body = geometry::AlignPoints(rest, posed).b_from_a;
  const Eigen::Vector3d forward = world_from_body.rotation * -Eigen::Vector3d::UnitY();
  const Eigen::Vector3d middle = posed.rowwise().mean();
  return forward.dot((view.crop.CenterInWorld() - middle).normalized());
}

/// Four pixels around a place and their shares.
struct Taps {
  int x = 0, y = 0;
  float right = 0, down = 0;
  float Share(int dx, int dy) const { return (dx ? right : 1 - right) * (dy ? down : 1 - down); }
};

Taps TapsAt(const Vector2f& px, int width, int height) {
  Taps taps;
  taps.x = std::clamp(static_cast<int>(std::floor(px[0])), 0, width - 2);
  taps.y = std::clamp(static_cast<int>(std::floor(px[1])), 0, height - 2);
  taps.right = px[0] - static_cast<float>(taps.x), taps.down = px[1] - static_cast<float>(taps.y);
  return taps;
}

constexpr float kNoShare = 1e-3f;  // pixels of a smaller share say nothing

Vector3f ColourAt(const Image& image, const Vector2f& px) {
  const Taps taps = TapsAt(px, image.width, image.height);
  Vector3f colour = Vector3f::Zero();
  for (const int dy : {0, 1}) {
    for (const int dx : {0, 1}) {
      const uint8_t* rgb = image.Pixel(taps.x + dx, taps.y + dy);
      for (int c = 0; c < 3; ++c) colour[c] += taps.Share(dx, dy) * static_cast<float>(rgb[c]);
    }
  }
  return colour;
}

}  // namespace

References::References(std::vector<ReferenceView> views, const body::BodyTemplate& body, int num_threads)
    : views_(std::move(views)), body_(body), prepared_(views_.size()) {
  for (const ReferenceView& view : views_)
    MVS_CHECK(
        view.vertices && view.vertices->cols() == body_.vertices.cols() && view.image.width >= 2 && view.image.height >= 2,
        "a reference of another body or without an image");
  ParallelFor(static_cast<int64_t>(views_.size()), num_threads, [&](int64_t i) {
    const ReferenceView& view = views_[static_cast<size_t>(i)];
    Prepared& prepared = prepared_[static_cast<size_t>(i)];
    prepared.in_cam = InCamera(*view.vertices, view.crop);
    prepared.depth_m = body::RasterizeBody(body_, *view.vertices, view.crop).depth_m;
    prepared.facing = FacingOf(body_, view);
  });
}

bool References::SeesPixels(size_t v, const Vector2f& px, float nearest_m) const {
  const Image& mask = views_[v].mask;
  const Taps taps = TapsAt(px, mask.width, mask.height);
  for (const int dy : {0, 1}) {
    for (const int dx : {0, 1}) {
      if (taps.Share(dx, dy) < kNoShare) continue;
      const int x = taps.x + dx, y = taps.y + dy;
      if (*mask.Pixel(x, y) < 128) return false;
      if (prepared_[v].depth_m[static_cast<size_t>(y) * mask.width + x] < nearest_m) return false;
    }
  }
  return true;
}

ReferenceSample References::Sample(size_t v, int face, const Vector3f& barycentric) const {
  const std::vector<Vector3f>& in_cam = prepared_[v].in_cam;
  const Vector3f &a = in_cam[body_.faces(0, face)], &b = in_cam[body_.faces(1, face)], &c = in_cam[body_.faces(2, face)];
  const Vector3f x = barycentric[0] * a + barycentric[1] * b + barycentric[2] * c;
  if (!(x[2] > 0.01f)) return {};
  const float cosine = -(b - a).cross(c - a).normalized().dot(x.normalized());
  if (!(cosine > kLeastCosine)) return {};
  const geometry::Camera& camera = views_[v].crop.camera;
  const auto fx = static_cast<float>(camera.params[0]), fy = static_cast<float>(camera.params[1]);
  const Vector2f px(fx * x[0] / x[2] + static_cast<float>(camera.params[2]),
                    fy * x[1] / x[2] + static_cast<float>(camera.params[3]));
  constexpr float kRound = 1e-3f;
  const Image& image = views_[v].image;
  if (!(px.minCoeff() > -kRound && px[0] < static_cast<float>(image.width - 1) + kRound &&
        px[1] < static_cast<float>(image.height - 1) + kRound))
    return {};
  // The surface falls away by up to this over the four pixels around the point.
  const float slope = std::sqrt(std::max(0.f, 1 - cosine * cosine)) / cosine, pixel_m = x[2] / std::min(fx, fy);
  if (!SeesPixels(v, px, x[2] - kDepthTolerance - 1.5f * pixel_m * slope)) return {};
  return {cosine, ColourAt(image, px)};
}

void WarpReferences(const References& references, const std::vector<size_t>& chosen, const body::FaceMap& surface,
                    uint8_t* out) {
  const size_t area = surface.face.size();
  std::fill_n(out, 4 * area, uint8_t{0});
  for (size_t p = 0; p < area; ++p) {
    if (surface.face[p] < 0) continue;
    Vector3f sum = Vector3f::Zero();
    float weight = 0;
    for (const size_t v : chosen) {
      const ReferenceSample sample = references.Sample(v, surface.face[p], surface.barycentric[p]);
      sum += sample.cosine * sample.colour, weight += sample.cosine;
    }
    if (!(weight > 0)) continue;
    for (size_t c = 0; c < 3; ++c)
      out[c * area + p] = static_cast<uint8_t>(std::lround(std::clamp(sum[static_cast<int>(c)] / weight, 0.f, 255.f)));
    out[3 * area + p] = 255;
  }
}

std::shared_ptr<const References> ReadReferences(const std::string& run_folder, const RunConfig& config,
                                                 const ModelOptions& options) {
  if (!TakesReferences(options)) return nullptr;
  if (!config.pack.fitted)
    throw FormatError(run_folder + "/" + kRunConfigFile, "/template/body", "is missing: references lie on a fitted body");
  const body::BodyTemplate& body = config.pack.fitted->person.body;
  return std::make_shared<const References>(
      ReadReferenceViews(run_folder + "/" + kReferencesFile, config.split, body.vertices.cols()), body, 1);
}

}  // namespace mvstudio::avatar
