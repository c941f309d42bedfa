#include "synth/body_scene.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "body/surface_nets.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::synth {
namespace {

struct Light {
  Eigen::Vector3f to_light;
  float strength;
};

constexpr float kAmbient = 0.46f;
const Light kLights[] = {{Eigen::Vector3f(0.50f, -0.55f, 0.67f), 0.36f}, {Eigen::Vector3f(-0.77f, 0.26f, 0.58f), 0.26f},
                         {Eigen::Vector3f(0.30f, 0.85f, 0.43f), 0.22f}};

/// One Embree device for the process: single-threaded builds, so that nothing depends on timing.
RTCDevice SharedDevice() {
  static const RTCDevice device = [] {
    RTCDevice created = rtcNewDevice("threads=1,set_affinity=0");
    if (!created) throw ResourceError("Embree cannot create a ray-tracing device");
    return created;
  }();
  return device;
}

Eigen::Vector3f Sample(const Image& chart, float u, float v) {
  const float x = std::clamp(u * chart.width - 0.5f, 0.f, chart.width - 1.001f);
  const float y = std::clamp(v * chart.height - 0.5f, 0.f, chart.height - 1.001f);
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float fx = x - ix, fy = y - iy;
  auto at = [&](int px, int py) {
    const uint8_t* p = chart.Pixel(px, py);
    return Eigen::Vector3f(p[0], p[1], p[2]);
  };
  return (1 - fy) * ((1 - fx) * at(ix, iy) + fx * at(ix + 1, iy)) + fy * ((1 - fx) * at(ix, iy + 1) + fx * at(ix + 1, iy + 1));
}

/// Pixels the person may touch: the rasterised silhouette grown by one pixel, as the first and last column of each row span.
std::vector<uint8_t> GrownSilhouette(const body::PartUvMap& map) {
  std::vector<uint8_t> grown(map.part.size(), 0);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      if (!map.part[static_cast<size_t>(y) * map.width + x]) continue;
      for (int v = std::max(0, y - 2); v <= std::min(map.height - 1, y + 2); ++v) {
        for (int u = std::max(0, x - 2); u <= std::min(map.width - 1, x + 2); ++u) grown[static_cast<size_t>(v) * map.width + u] = 1;
      }
    }
  }
  return grown;
}

}  // namespace

struct BodyScene::Impl {
  const body::BodyTemplate& body;
  const std::array<Image, body::kNumParts>& textures;
  Eigen::Matrix3Xf vertices, normals;
  RTCScene scene = nullptr;

  struct Hit {
    bool found = false;
    int part = 0;
    float u = 0, v = 0, distance = 0;
    Eigen::Vector3f color = Eigen::Vector3f::Zero();
  };

  void Build();
  RTCRayHit Shoot(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;
  Hit Trace(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, bool shade) const;
};

void BodyScene::Impl::Build() {
  scene = rtcNewScene(SharedDevice());
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(SharedDevice(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                             static_cast<size_t>(vertices.cols())));
  auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 3 * sizeof(unsigned), static_cast<size_t>(body.faces.cols())));
  if (!points || !indices) throw ResourceError("Embree has no memory for the person's mesh");
  std::copy(vertices.data(), vertices.data() + vertices.size(), points);
  std::copy(body.faces.data(), body.faces.data() + body.faces.size(), indices);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);
}

RTCRayHit BodyScene::Impl::Shoot(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  RTCRayHit query{};
  query.ray.org_x = origin[0], query.ray.org_y = origin[1], query.ray.org_z = origin[2];
  query.ray.dir_x = direction[0], query.ray.dir_y = direction[1], query.ray.dir_z = direction[2];
  query.ray.tfar = std::numeric_limits<float>::infinity();
  query.ray.mask = ~0u;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene, &context, &query);
  return query;
}

BodyScene::Impl::Hit BodyScene::Impl::Trace(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, bool shade) const {
  const RTCRayHit query = Shoot(origin, direction);
  Hit hit;
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return hit;
  const int face = static_cast<int>(query.hit.primID);
  const float b = query.hit.u, c = query.hit.v, a = 1 - b - c;
  const Eigen::Vector2f uv = a * body.face_uv.col(3 * face) + b * body.face_uv.col(3 * face + 1) + c * body.face_uv.col(3 * face + 2);
  hit = {true, body.face_part[face], uv[0], uv[1], query.ray.tfar, Eigen::Vector3f::Zero()};
  if (!shade) return hit;
  const Eigen::Vector3i corner = body.faces.col(face);
  const Eigen::Vector3f normal = (a * normals.col(corner[0]) + b * normals.col(corner[1]) + c * normals.col(corner[2])).normalized();
  float light = kAmbient;
  for (const Light& l : kLights) light += l.strength * std::max(0.f, normal.dot(l.to_light));
  hit.color = light * Sample(textures[hit.part - 1], hit.u, hit.v);
  return hit;
}

BodyScene::BodyScene(const body::BodyTemplate& body, const std::array<Image, body::kNumParts>& textures,
                     const Eigen::Matrix3Xf& vertices_in_world) {
  MVS_CHECK(vertices_in_world.cols() == body.vertices.cols(), vertices_in_world.cols() << " vertices for a body of " << body.vertices.cols());
  impl_.reset(new Impl{body, textures, vertices_in_world, body::VertexNormals(vertices_in_world, body.faces)});
  impl_->Build();
}

BodyScene::~BodyScene() {
  if (impl_ && impl_->scene) rtcReleaseScene(impl_->scene);
}

BodyScene::Truth BodyScene::Draw(const geometry::RigCamera& camera, const LensRays& rays, int samples, Image* picture) const {
  const std::vector<uint8_t> candidates = GrownSilhouette(body::RasterizeBody(impl_->body, impl_->vertices, camera));
  Truth truth;
  truth.part.assign(candidates.size(), 0);
  truth.u = truth.v = truth.part;
  const float total = static_cast<float>(samples * samples);
  for (int y = 0; y < rays.height(); ++y) {
    for (int x = 0; x < rays.width(); ++x) {
      const size_t at = static_cast<size_t>(y) * rays.width() + x;
      if (!candidates[at]) continue;
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      float hits = 0;
      for (int s = 0; s < samples * samples; ++s) {
        const Eigen::Vector3f ray = rays.Direction(x, y, (s % samples + 0.5) / samples - 0.5, (s / samples + 0.5) / samples - 0.5);
        const Impl::Hit hit = impl_->Trace(rays.origin(), ray, true);
        if (hit.found) sum += hit.color, ++hits;
      }
      uint8_t* pixel = picture->Pixel(x, y);
      for (int k = 0; k < 3; ++k) pixel[k] = static_cast<uint8_t>(std::clamp((sum[k] + (total - hits) * pixel[k]) / total + 0.5f, 0.f, 255.f));
      const Impl::Hit center = impl_->Trace(rays.origin(), rays.Direction(x, y, 0, 0), false);
      if (!center.found) continue;
      truth.part[at] = static_cast<uint8_t>(center.part);
      truth.u[at] = static_cast<uint8_t>(std::lround(255 * std::clamp(center.u, 0.f, 1.f)));
      truth.v[at] = static_cast<uint8_t>(std::lround(255 * std::clamp(center.v, 0.f, 1.f)));
    }
  }
  return truth;
}

double BodyScene::DepthBehindSurface(const Eigen::Vector3d& origin, const Eigen::Vector3d& x_in_world) const {
  const Eigen::Vector3d way = x_in_world - origin;
  const Impl::Hit hit = impl_->Trace(origin.cast<float>(), way.normalized().cast<float>(), false);
  return hit.found ? std::max(0.0, way.norm() - hit.distance) : 0.0;
}

}  // namespace mvstudio::synth
