#include "synth/body_scene.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "avatar/body/surface_nets.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::synth {
namespace {

struct Light {
  Eigen::Vector3f to_light;
  float strength;
};

constexpr float kAmbient = 0.46f;
const Light kLights[] = {{Eigen::Vector3f(0.50f, -0.55f, 0.67f), 0.36f},
                         {Eigen::Vector3f(-0.77f, 0.26f, 0.58f), 0.26f},
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

/// Pixels the person may touch: the rasterised silhouette grown by two pixels.
std::vector<uint8_t> GrownSilhouette(const body::PartUvMap& map) {
  std::vector<uint8_t> grown(map.part.size(), 0);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      if (!map.part[static_cast<size_t>(y) * map.width + x]) continue;
      for (int v = std::max(0, y - 2); v <= std::min(map.height - 1, y + 2); ++v) {
        for (int u = std::max(0, x - 2); u <= std::min(map.width - 1, x + 2); ++u)
          grown[static_cast<size_t>(v) * map.width + u] = 1;
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
  bool two_sided = false;
  RTCScene scene = nullptr;

  struct Hit {
    int face = -1;                     // -1: nothing met
    float b = 0, c = 0, distance = 0;  // barycentric coordinates of the face's corners 1 and 2; in lengths of the direction
    bool behind = false;               // met from inside
  };

  void Build();
  void Trace(const Eigen::Vector3f& origin, const Eigen::Vector3f* directions, int count, Hit* hits) const;
  bool FromBehind(int face, const Eigen::Vector3f& direction) const;
  Eigen::Vector2f ChartUv(const Hit& hit) const;
  Eigen::Vector3f Shade(const Hit& hit) const;
  void Blend(const std::vector<Hit>& hits, int count, uint8_t* pixel) const;
};

void BodyScene::Impl::Build() {
  scene = rtcNewScene(SharedDevice());
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(SharedDevice(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                             3 * sizeof(float), static_cast<size_t>(vertices.cols())));
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

namespace {

void SetRay(RTCRayHit16* query, int lane, const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) {
  query->ray.org_x[lane] = origin[0], query->ray.org_y[lane] = origin[1], query->ray.org_z[lane] = origin[2];
  query->ray.dir_x[lane] = direction[0], query->ray.dir_y[lane] = direction[1], query->ray.dir_z[lane] = direction[2];
  query->ray.tnear[lane] = query->ray.time[lane] = 0;
  query->ray.tfar[lane] = std::numeric_limits<float>::infinity();
  query->ray.mask[lane] = ~0u;
  query->ray.id[lane] = query->ray.flags[lane] = 0;
  query->hit.geomID[lane] = query->hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
}

}  // namespace

void BodyScene::Impl::Trace(const Eigen::Vector3f& origin, const Eigen::Vector3f* directions, int count, Hit* hits) const {
  alignas(64) RTCRayHit16 query;
  for (int first = 0; first < count; first += 16) {
    const int lanes = std::min(16, count - first);
    alignas(64) int valid[16];
    for (int lane = 0; lane < 16; ++lane) {
      valid[lane] = lane < lanes && !directions[first + lane].isZero() ? -1 : 0;
      SetRay(&query, lane, origin, valid[lane] ? directions[first + lane] : Eigen::Vector3f(0, 0, 1));
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(valid, scene, &context, &query);
    for (int lane = 0; lane < lanes; ++lane) {
      Hit& hit = hits[first + lane];
      hit.face =
          valid[lane] && query.hit.geomID[lane] != RTC_INVALID_GEOMETRY_ID ? static_cast<int>(query.hit.primID[lane]) : -1;
      hit.b = query.hit.u[lane], hit.c = query.hit.v[lane], hit.distance = query.ray.tfar[lane];
      hit.behind = two_sided && hit.face >= 0 && FromBehind(hit.face, directions[first + lane]);
    }
  }
}

bool BodyScene::Impl::FromBehind(int face, const Eigen::Vector3f& direction) const {
  const Eigen::Vector3f a = vertices.col(body.faces(0, face)), b = vertices.col(body.faces(1, face));
  return (b - a).cross(vertices.col(body.faces(2, face)) - a).dot(direction) > 0;
}

Eigen::Vector2f BodyScene::Impl::ChartUv(const Hit& hit) const {
  return (1 - hit.b - hit.c) * body.face_uv.col(3 * hit.face) + hit.b * body.face_uv.col(3 * hit.face + 1) +
         hit.c * body.face_uv.col(3 * hit.face + 2);
}

Eigen::Vector3f BodyScene::Impl::Shade(const Hit& hit) const {
  const Eigen::Vector3i corner = body.faces.col(hit.face);
  const Eigen::Vector3f normal =
      ((1 - hit.b - hit.c) * normals.col(corner[0]) + hit.b * normals.col(corner[1]) + hit.c * normals.col(corner[2]))
          .normalized();
  const float side = hit.behind ? -1.f : 1.f;
  float light = kAmbient;
  for (const Light& l : kLights) light += l.strength * std::max(0.f, side * normal.dot(l.to_light));
  const Eigen::Vector2f uv = ChartUv(hit);
  return light * Sample(textures[body.face_part[hit.face] - 1], uv[0], uv[1]);
}

/// Mean colour of the first `count` samples; those that met nothing keep the pixel's own.
void BodyScene::Impl::Blend(const std::vector<Hit>& hits, int count, uint8_t* pixel) const {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  int misses = 0;
  for (int s = 0; s < count; ++s) {
    if (hits[s].face >= 0) {
      sum += Shade(hits[s]);
    } else {
      ++misses;
    }
  }
  for (int k = 0; k < 3; ++k)
    pixel[k] = static_cast<uint8_t>(std::clamp((sum[k] + misses * pixel[k]) / count + 0.5f, 0.f, 255.f));
}

BodyScene::BodyScene(const body::BodyTemplate& body, const std::array<Image, body::kNumParts>& textures,
                     const Eigen::Matrix3Xf& vertices_in_world, bool two_sided) {
  MVS_CHECK(vertices_in_world.cols() == body.vertices.cols(), vertices_in_world.cols()
                                                                  << " vertices for a body of " << body.vertices.cols());
  impl_.reset(new Impl{body, textures, vertices_in_world, body::VertexNormals(vertices_in_world, body.faces), two_sided});
  impl_->Build();
}

BodyScene::~BodyScene() {
  if (impl_ && impl_->scene) rtcReleaseScene(impl_->scene);
}

BodyScene::Truth BodyScene::Draw(const geometry::RigCamera& camera, const LensRays& rays, int samples, Image* image) const {
  const std::vector<uint8_t> candidates = GrownSilhouette(body::RasterizeBody(impl_->body, impl_->vertices, camera));
  Truth truth;
  truth.part.assign(candidates.size(), 0);
  truth.u = truth.v = truth.part;
  const int count = samples * samples;
  std::vector<Eigen::Vector3f> directions(count + 1);  // the last goes through the centre
  std::vector<Impl::Hit> hits(count + 1);
  for (int y = 0; y < rays.height(); ++y) {
    for (int x = 0; x < rays.width(); ++x) {
      const size_t at = static_cast<size_t>(y) * rays.width() + x;
      if (!candidates[at]) continue;
      for (int s = 0; s < count; ++s) {
        directions[s] = rays.Direction(x, y, (s % samples + 0.5) / samples - 0.5, (s / samples + 0.5) / samples - 0.5);
      }
      directions[count] = rays.Direction(x, y, 0, 0);
      impl_->Trace(rays.origin(), directions.data(), count + 1, hits.data());
      impl_->Blend(hits, count, image->Pixel(x, y));
      if (hits[count].face < 0) continue;
      const Eigen::Vector2f uv = impl_->ChartUv(hits[count]).cwiseMax(0.f).cwiseMin(1.f);
      truth.part[at] = static_cast<uint8_t>(impl_->body.face_part[hits[count].face]);
      truth.u[at] = static_cast<uint8_t>(std::lround(255 * uv[0]));
      truth.v[at] = static_cast<uint8_t>(std::lround(255 * uv[1]));
    }
  }
  return truth;
}

double BodyScene::DepthBehindSurface(const Eigen::Vector3d& origin, const Eigen::Vector3d& x_in_world) const {
  const Eigen::Vector3d way = x_in_world - origin;
  const Eigen::Vector3f direction = way.normalized().cast<float>();
  Impl::Hit hit;
  impl_->Trace(origin.cast<float>(), &direction, 1, &hit);
  return hit.face >= 0 ? std::max(0.0, way.norm() - hit.distance) : 0.0;
}

}  // namespace mvstudio::synth
